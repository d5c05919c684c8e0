//! Where x86-64 code leaves a function.
//!
//! Two ways of the compiler look like calls through a pointer and are none: a `match` that jumps by a table,
//! and the address of an import that is loaded once, kept in a register and called twice. For both the
//! analysis follows every path to the leap; what it is not sure of on all of them it does not know.
//!
//! A table holds distances from itself: `lea t, [table]; movsxd d, [t + 4 i]; add d, t; jmp d`. How many is not
//! known. Read are all up to the first that leads to no instruction of the function, which adds ways that
//! nobody goes, and leaves out none.

use std::collections::BTreeMap;

use iced_x86::{
    Code, Decoder, DecoderOptions, FlowControl, Instruction, InstructionInfoFactory, Mnemonic, OpAccess,
    OpKind, Register,
};

use super::executable::{Constants, Leap, Leaps};

/// What a register holds.
#[derive(Clone, Copy, PartialEq)]
enum Value {
    /// What the pointer at this address points to.
    PointerAt(u64),
    /// This address.
    Address(u64),
    /// A distance out of the table at this address.
    Distance(u64),
    /// The address of a table and a distance out of it.
    Sum(u64),
}

/// What is known of the registers.
type Known = BTreeMap<Register, Value>;

/// What a called function may change (System V ABI).
const CALL_CLOBBERS: [Register; 9] = [
    Register::RAX,
    Register::RCX,
    Register::RDX,
    Register::RSI,
    Register::RDI,
    Register::R8,
    Register::R9,
    Register::R10,
    Register::R11,
];

pub fn leaps(code: &[u8], address: u64, constants: &Constants) -> Leaps {
    let instructions = Decoder::with_ip(64, code, address, DecoderOptions::NONE).into_iter().collect();
    let function = Function { instructions, constants };
    let known = function.known_before_each();
    let leap = |index: usize| Some((function.instructions[index].ip(), function.leap(index, &known[index])?));
    (0..known.len()).filter_map(leap).collect()
}

/// A function, and the data that its tables are part of.
struct Function<'a> {
    instructions: Vec<Instruction>,
    constants: &'a Constants,
}

impl Function<'_> {
    fn leap(&self, index: usize, known: &Known) -> Option<Leap> {
        let instruction = &self.instructions[index];
        match instruction.flow_control() {
            FlowControl::Next if instruction.mnemonic() == Mnemonic::Hlt => Some(Leap::Trap),
            FlowControl::Next | FlowControl::Return => None,
            _ if instruction.op0_kind() == OpKind::NearBranch64 => {
                Some(Leap::To(instruction.near_branch_target()))
            }
            FlowControl::IndirectBranch if self.targets(index, known).is_some() => None,
            FlowControl::IndirectBranch | FlowControl::IndirectCall => Some(pointer(instruction, known)),
            // ud2, int, what is no instruction; `syscall` counts as a call.
            _ => Some(Leap::Trap),
        }
    }

    /// Where a jump by a table may go on, if this is one.
    fn targets(&self, index: usize, known: &Known) -> Option<Vec<usize>> {
        let jump = &self.instructions[index];
        let register = (jump.op0_kind() == OpKind::Register).then(|| jump.op0_register())?;
        if let Some(Value::Sum(table)) = known.get(&register) {
            let distances = (0..).map_while(|entry| self.constants.word(table + 4 * entry));
            let targets = distances.map_while(|distance| self.at(table.wrapping_add_signed(distance.into())));
            return Some(targets.collect::<Vec<_>>()).filter(|targets| !targets.is_empty());
        }
        // A sum all the same, which a pointer to a function is not. Which table is not known: it leads anywhere.
        let before = &self.instructions[index.checked_sub(1)?];
        let is_sum = before.mnemonic() == Mnemonic::Add && before.op0_register() == register;
        is_sum.then(|| (0..self.instructions.len()).collect())
    }

    /// The instruction at an address.
    fn at(&self, address: u64) -> Option<usize> {
        self.instructions.binary_search_by_key(&address, Instruction::ip).ok()
    }

    /// What is known before each instruction, whichever way it was reached.
    fn known_before_each(&self) -> Vec<Known> {
        let mut before: Vec<Option<Known>> = vec![None; self.instructions.len()];
        let mut info = InstructionInfoFactory::new();
        // Nothing is known at the entry, nor where only unwinding leads. Between blocks there is padding.
        let is_entry = |index: usize| index == 0 || self.instructions[index].mnemonic() != Mnemonic::Nop;
        for entry in (0..before.len()).filter(|index| is_entry(*index)) {
            let mut waiting = vec![];
            if before[entry].is_none() {
                waiting.push((entry, Known::new()));
            }
            while let Some((index, mut known)) = waiting.pop() {
                if let Some(other) = &before[index] {
                    known.retain(|register, value| other.get(register) == Some(value));
                }
                if before[index].as_ref() != Some(&known) {
                    let after = known_after(&self.instructions[index], &known, &mut info);
                    waiting
                        .extend(self.following(index, &known).into_iter().map(|next| (next, after.clone())));
                    before[index] = Some(known);
                }
            }
        }
        before.into_iter().map(Option::unwrap_or_default).collect()
    }

    /// The instructions of the function that may come after this one.
    fn following(&self, index: usize, known: &Known) -> Vec<usize> {
        let instruction = &self.instructions[index];
        let next = index + 1..(index + 2).min(self.instructions.len());
        let target = || self.at(instruction.near_branch_target());
        match instruction.flow_control() {
            FlowControl::Return => vec![],
            // Without a table it leaves the function.
            FlowControl::IndirectBranch => self.targets(index, known).unwrap_or_default(),
            FlowControl::UnconditionalBranch => target().into_iter().collect(),
            FlowControl::ConditionalBranch => next.chain(target()).collect(),
            _ => next.collect(),
        }
    }
}

fn pointer(instruction: &Instruction, known: &Known) -> Leap {
    let at = match instruction.op0_kind() {
        OpKind::Register => match known.get(&instruction.op0_register()) {
            Some(Value::PointerAt(at)) => Some(*at),
            _ => None,
        },
        _ => fixed_address(instruction),
    };
    at.map_or(Leap::Somewhere, Leap::ThroughPointerAt)
}

/// The address of the operand in memory, if that is the same each time.
fn fixed_address(instruction: &Instruction) -> Option<u64> {
    instruction.is_ip_rel_memory_operand().then(|| instruction.ip_rel_memory_address())
}

fn known_after(instruction: &Instruction, known: &Known, info: &mut InstructionInfoFactory) -> Known {
    let mut after = known.clone();
    for used in info.info(instruction).used_registers() {
        if !matches!(used.access(), OpAccess::Read | OpAccess::CondRead) {
            after.remove(&used.register().full_register());
        }
    }
    if matches!(instruction.flow_control(), FlowControl::Call | FlowControl::IndirectCall) {
        after.retain(|register, _| !CALL_CLOBBERS.contains(register));
    }
    if instruction.op0_kind() == OpKind::Register
        && let Some(value) = value(instruction, known)
    {
        after.insert(instruction.op0_register(), value);
    }
    after
}

/// What an instruction puts into its first register.
fn value(instruction: &Instruction, known: &Known) -> Option<Value> {
    let held = |register: Register| known.get(&register).copied();
    let from_memory = instruction.op1_kind() == OpKind::Memory;
    match instruction.code() {
        Code::Mov_r64_rm64 if from_memory => fixed_address(instruction).map(Value::PointerAt),
        Code::Mov_r64_rm64 | Code::Mov_rm64_r64 => held(instruction.op1_register()),
        Code::Lea_r64_m => fixed_address(instruction).map(Value::Address),
        Code::Movsxd_r64_rm32 if from_memory => match held(instruction.memory_base()) {
            Some(Value::Address(table))
                if instruction.memory_index_scale() == 4 && instruction.memory_displacement64() == 0 =>
            {
                Some(Value::Distance(table))
            }
            _ => None,
        },
        Code::Add_r64_rm64 | Code::Add_rm64_r64 if !from_memory => {
            match (held(instruction.op0_register())?, held(instruction.op1_register())?) {
                (Value::Address(table), Value::Distance(of))
                | (Value::Distance(of), Value::Address(table))
                    if of == table =>
                {
                    Some(Value::Sum(table))
                }
                _ => None,
            }
        }
        _ => None,
    }
}

/// What a call through rbx or rax is taken for, after instructions that leave an import there or not.
#[test]
fn a_register_holds_an_import_only_if_it_does_on_every_path() {
    const LOAD_RBX: &[u8] = &[0x48, 0x8B, 0x1D, 0, 0, 0, 0]; // mov rbx, [rip]
    const LOAD_RAX: &[u8] = &[0x48, 0x8B, 0x05, 0, 0, 0, 0]; // mov rax, [rip]
    const COPY_RBX: &[u8] = &[0x48, 0x89, 0xC3]; // mov rbx, rax
    const OTHER_RBX: &[u8] = &[0x48, 0x89, 0xF3]; // mov rbx, rsi
    const OTHER_EBX: &[u8] = &[0xBB, 1, 0, 0, 0]; // mov ebx, 1
    const OVER_3: &[u8] = &[0x74, 3]; // je, over OTHER_RBX
    const OVER_7: &[u8] = &[0x74, 7]; // je, over LOAD_RBX
    const CALL_RBX: &[u8] = &[0xFF, 0xD3];
    const CALL_RAX: &[u8] = &[0xFF, 0xD0];
    const AGAIN: &[u8] = &[0x75, 0xF4]; // jne, back over 10 bytes and itself

    for (what, code, import) in [
        ("loaded", &[LOAD_RBX, CALL_RBX][..], true),
        ("kept over a call", &[LOAD_RBX, CALL_RBX, CALL_RBX], true),
        ("copied", &[LOAD_RAX, COPY_RBX, CALL_RBX], true),
        ("never loaded", &[CALL_RBX], false),
        ("overwritten", &[LOAD_RBX, OTHER_RBX, CALL_RBX], false),
        ("overwritten in half", &[LOAD_RBX, OTHER_EBX, CALL_RBX], false),
        ("lost in a call", &[LOAD_RAX, CALL_RAX, CALL_RAX], false),
        ("overwritten on one path", &[LOAD_RBX, OVER_3, OTHER_RBX, CALL_RBX], false),
        ("loaded on one path", &[OTHER_RBX, OVER_7, LOAD_RBX, CALL_RBX], false),
        ("overwritten in a loop", &[LOAD_RBX, CALL_RBX, OTHER_RBX, OTHER_EBX, AGAIN], false),
    ] {
        let mut calls = leaps(&code.concat(), 0x1000, &Constants::default());
        calls.retain(|(_, leap)| !matches!(leap, Leap::To(_)));
        let all_known = calls.iter().all(|(_, leap)| matches!(leap, Leap::ThroughPointerAt(_)));
        assert!(!calls.is_empty() && all_known == import, "{what}: {calls:x?}");
    }
}

/// What a call is taken for that follows a load of its import, behind a jump by a table to the load or elsewhere.
#[test]
fn a_table_leads_to_the_instructions_in_it() {
    const TABLE: &[u8] = &[0x48, 0x8D, 0x35, 0xF9, 0x0F, 0, 0]; // lea rsi, [0x2000]
    const DISTANCE: &[u8] = &[0x48, 0x63, 0x04, 0x86]; // movsxd rax, [rsi + 4 rax]
    const NO_DISTANCE: &[u8] = &[0x48, 0x63, 0x04, 0x46]; // movsxd rax, [rsi + 2 rax]
    const NEXT_TABLE: &[u8] = &[0x48, 0x8D, 0x35, 0xF2, 0x0F, 0, 0]; // lea rsi, [0x2004], behind DISTANCE
    const SUM: &[u8] = &[0x48, 0x01, 0xF0]; // add rax, rsi
    const OTHER_SUM: &[u8] = &[0x48, 0x01, 0xC6, 0x48, 0x89, 0xF0]; // add rsi, rax; mov rax, rsi
    const TWICE: &[u8] = &[0x48, 0x01, 0xC0]; // add rax, rax
    const BETWEEN: &[u8] = &[0x48, 0x89, 0xD1]; // mov rcx, rdx
    const OTHER_RAX: &[u8] = &[0x48, 0x89, 0xD0]; // mov rax, rdx
    const JUMP: &[u8] = &[0xFF, 0xE0]; // jmp rax
    const END: &[u8] = &[0x48, 0x8B, 0x1D, 0, 0, 0, 0, 0xFF, 0xD3, 0xC3]; // mov rbx, [rip]; call rbx; ret
    const LOAD: i32 = 0;
    const CALL: i32 = 7;
    const RET: i32 = 9;

    for (what, code, entries, is_jump, is_import) in [
        ("load and end", &[DISTANCE, SUM][..], &[LOAD, RET][..], true, true),
        ("something between", &[DISTANCE, SUM, BETWEEN], &[LOAD], true, true),
        ("the sum elsewhere", &[DISTANCE, OTHER_SUM], &[LOAD], true, true),
        ("without the load", &[DISTANCE, SUM], &[LOAD, CALL], true, false),
        ("beyond the table", &[DISTANCE, SUM], &[LOAD, 1000, CALL], true, true),
        ("another scale", &[NO_DISTANCE, SUM], &[LOAD], true, false),
        ("another sum", &[DISTANCE, TWICE], &[LOAD], true, false),
        ("of two tables", &[DISTANCE, NEXT_TABLE, SUM], &[LOAD, LOAD], true, false),
        ("of other functions", &[DISTANCE, SUM], &[1000, LOAD], false, true),
        ("overwritten", &[DISTANCE, SUM, OTHER_RAX], &[LOAD], false, true),
    ] {
        let head = [&[TABLE], code, &[JUMP]].concat().concat();
        let end = 0x1000 + head.len() as i32;
        let words = entries.iter().flat_map(|entry| (end + entry - 0x2000).to_le_bytes()).collect();
        let found = leaps(&[&head, END].concat(), 0x1000, &Constants(vec![(0x2000, words)]));
        let leap_at =
            |address: i32| found.iter().find(|(at, _)| *at == address as u64).map(|(_, leap)| *leap);
        assert_eq!(leap_at(end - 2).is_none(), is_jump, "{what}: {found:x?}");
        let call = leap_at(end + CALL).unwrap();
        assert_eq!(matches!(call, Leap::ThroughPointerAt(_)), is_import, "{what}: {found:x?}");
    }
}
