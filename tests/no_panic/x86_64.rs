//! Where x86-64 code leaves a function.
//!
//! Two ways of the compiler look like calls through a pointer and are none: a `match` that jumps by a table,
//! and the address of an import that is loaded once, kept in a register and called twice. For the second the
//! analysis follows every path to the call; what it is not sure of on all of them it does not know.

use std::collections::BTreeMap;

use iced_x86::{
    Code, Decoder, DecoderOptions, FlowControl, Instruction, InstructionInfoFactory, Mnemonic, OpAccess,
    OpKind, Register,
};

use crate::executable::{Leap, Leaps};

/// Which registers hold what the pointer at which address points to.
type Known = BTreeMap<Register, u64>;

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

pub fn leaps(code: &[u8], address: u64) -> Leaps {
    let instructions: Vec<Instruction> =
        Decoder::with_ip(64, code, address, DecoderOptions::NONE).into_iter().collect();
    let known = known_before_each(&instructions);
    let leap = |(index, instruction): (usize, &Instruction)| {
        let before = &instructions[index.saturating_sub(1)];
        Some((instruction.ip(), leap(before, instruction, &known[index])?))
    };
    instructions.iter().enumerate().filter_map(leap).collect()
}

fn leap(before: &Instruction, instruction: &Instruction, known: &Known) -> Option<Leap> {
    match instruction.flow_control() {
        FlowControl::Next if instruction.mnemonic() == Mnemonic::Hlt => Some(Leap::Trap),
        FlowControl::Next | FlowControl::Return => None,
        _ if instruction.op0_kind() == OpKind::NearBranch64 => {
            Some(Leap::To(instruction.near_branch_target()))
        }
        FlowControl::IndirectBranch if is_jump_table(before, instruction) => None,
        FlowControl::IndirectBranch | FlowControl::IndirectCall => Some(pointer(instruction, known)),
        // ud2, int, what is no instruction; `syscall` counts as a call.
        _ => Some(Leap::Trap),
    }
}

/// The table holds distances, so the target is a sum. A pointer to a function is not.
fn is_jump_table(before: &Instruction, jump: &Instruction) -> bool {
    before.mnemonic() == Mnemonic::Add
        && jump.op0_kind() == OpKind::Register
        && before.op0_register() == jump.op0_register()
}

fn pointer(instruction: &Instruction, known: &Known) -> Leap {
    let at = match instruction.op0_kind() {
        OpKind::Register => known.get(&instruction.op0_register()).copied(),
        _ => instruction.is_ip_rel_memory_operand().then(|| instruction.ip_rel_memory_address()),
    };
    at.map_or(Leap::Somewhere, Leap::ThroughPointerAt)
}

/// What is known before each instruction, whichever way it was reached.
fn known_before_each(instructions: &[Instruction]) -> Vec<Known> {
    let mut before: Vec<Option<Known>> = vec![None; instructions.len()];
    let mut info = InstructionInfoFactory::new();
    // Nothing is known at the entry, nor where only unwinding leads. Between blocks there is padding.
    let is_entry = |index: usize| index == 0 || instructions[index].mnemonic() != Mnemonic::Nop;
    for entry in (0..instructions.len()).filter(|index| is_entry(*index)) {
        let mut waiting = vec![];
        if before[entry].is_none() {
            waiting.push((entry, Known::new()));
        }
        while let Some((index, mut known)) = waiting.pop() {
            if let Some(other) = &before[index] {
                known.retain(|register, at| other.get(register) == Some(at));
            }
            if before[index].as_ref() != Some(&known) {
                let after = known_after(&instructions[index], &known, &mut info);
                before[index] = Some(known);
                waiting.extend(following(instructions, index).into_iter().map(|next| (next, after.clone())));
            }
        }
    }
    before.into_iter().map(Option::unwrap_or_default).collect()
}

/// The instructions of the function that may come after this one.
fn following(instructions: &[Instruction], index: usize) -> Vec<usize> {
    let instruction = &instructions[index];
    let next = index + 1..(index + 2).min(instructions.len());
    let target =
        || instructions.binary_search_by_key(&instruction.near_branch_target(), Instruction::ip).ok();
    match instruction.flow_control() {
        FlowControl::Return => vec![],
        // A jump table may lead anywhere.
        FlowControl::IndirectBranch => (0..instructions.len()).collect(),
        FlowControl::UnconditionalBranch => target().into_iter().collect(),
        FlowControl::ConditionalBranch => next.chain(target()).collect(),
        _ => next.collect(),
    }
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
    if matches!(instruction.code(), Code::Mov_r64_rm64 | Code::Mov_rm64_r64) {
        let at = match instruction.op1_kind() {
            OpKind::Register => known.get(&instruction.op1_register()).copied(),
            _ => instruction.is_ip_rel_memory_operand().then(|| instruction.ip_rel_memory_address()),
        };
        let to_register = instruction.op0_kind() == OpKind::Register;
        after.extend(at.filter(|_| to_register).map(|at| (instruction.op0_register(), at)));
    }
    after
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
        let mut calls = leaps(&code.concat(), 0x1000);
        calls.retain(|(_, leap)| !matches!(leap, Leap::To(_)));
        let all_known = calls.iter().all(|(_, leap)| matches!(leap, Leap::ThroughPointerAt(_)));
        assert!(!calls.is_empty() && all_known == import, "{what}: {calls:x?}");
    }
}
