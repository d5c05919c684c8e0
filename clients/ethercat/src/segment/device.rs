//! One simulated device: its EtherCAT controller (registers, sync managers, distributed clock), and the drive behind it.
//! ETG1000.4, and the data sheet of the ET1100.

use super::local_clock::LocalClock;
use super::mechanics::LegForce;
use super::object_dictionary::{MappedObject, ObjectDictionary};
use super::servo_drive::{DriveCommand, ServoDrive};
use super::sii;
use crate::al_state::{INIT, OP, SAFE_OP};
use crate::identity::Identity;
use crate::objects;
use crate::units::LegUnits;

pub(super) const MEMORY: usize = 0x2000;
/// Period of the firmware while there is no SYNC0 \[ns\].
const FREE_RUN_NS: u64 = 1_000_000;

/// Description of a simulated device.
#[derive(Clone, Copy, Debug)]
pub struct DeviceModel {
    /// Numbers in its EEPROM.
    pub identity: Identity,
    /// Encoder, screw and motor.
    pub units: LegUnits,
    /// 0x6072
    pub max_torque_permille: u16,
    /// Of its clock, in millionths.
    pub drift_ppm: f64,
}

/// One device.
#[derive(Clone, Debug)]
pub struct Device {
    /// What it is.
    pub model: DeviceModel,
    /// Its firmware.
    pub drive: ServoDrive,
    /// Its objects.
    pub objects: ObjectDictionary,
    /// AL status code with which a change to a state is refused.
    pub refusal: Option<(u8, u16)>,
    /// The encoder counts against the direction of the torque.
    pub is_encoder_reversed: bool,
    /// Force above which the closed brake slips \[N\].
    pub brake_n: f64,
    /// The watchdog cannot be set.
    pub is_watchdog_fixed: bool,
    /// Error code of an emergency that the device is about to send: before its response to the next request, or at once in OP.
    pub emergency: Option<u16>,
    pub(super) memory: Box<[u8; MEMORY]>,
    /// Response that waits until the mailbox has been read.
    pub(super) waiting_response: Option<Vec<u8>>,
    sii: Vec<u8>,
    pub(super) clock: LocalClock,
    pub(super) outputs: Vec<MappedObject>,
    pub(super) inputs: Vec<MappedObject>,
    pub(super) outputs_ns: Option<u64>,
    pub(super) is_op_requested: bool,
    /// System time of the next SYNC0.
    next_sync0_ns: Option<u64>,
    next_free_run_ns: u64,
}

impl Device {
    /// A device that has just been switched on; its clock shows `start_ns` at the instant 0.
    pub fn new(model: DeviceModel, start_ns: i64) -> Self {
        let mut memory = Box::new([0; MEMORY]);
        // An ET1100 with 8 FMMUs, 8 sync managers, 8 KB of memory, two ports and distributed clocks of 64 bits.
        memory[..10].copy_from_slice(&[0x11, 0, 0, 0, 8, 8, 8, 0x0f, 0xfc, 0x01]);
        memory[0x130] = INIT;
        // Watchdog: units of 100 us, of which 1000.
        memory[0x400..0x402].copy_from_slice(&2498u16.to_le_bytes());
        memory[0x420..0x422].copy_from_slice(&1000u16.to_le_bytes());
        memory[0x440] = 1;
        Self {
            model,
            drive: ServoDrive::default(),
            objects: ObjectDictionary::new(&model),
            refusal: None,
            is_encoder_reversed: false,
            brake_n: f64::INFINITY,
            is_watchdog_fixed: false,
            emergency: None,
            memory,
            waiting_response: None,
            sii: sii::content(model.identity),
            clock: LocalClock::new(start_ns, model.drift_ppm),
            outputs: vec![],
            inputs: vec![],
            outputs_ns: None,
            is_op_requested: false,
            next_sync0_ns: None,
            next_free_run_ns: 0,
        }
    }

    /// State of the application layer, with the error bit.
    pub fn al_status(&self) -> u8 {
        self.memory[0x130]
    }

    /// Code of the last error of the application layer.
    pub fn al_status_code(&self) -> u16 {
        self.u16_at(0x134)
    }

    /// A fault of the drive, with its emergency.
    pub fn trip(&mut self, error_code: u16) {
        self.drive.trip(error_code);
        self.emergency = Some(error_code);
    }

    pub(super) fn u16_at(&self, address: usize) -> u16 {
        u16::from_le_bytes([self.memory[address], self.memory[address + 1]])
    }

    fn u64_at(&self, address: usize) -> u64 {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&self.memory[address..address + 8]);
        u64::from_le_bytes(bytes)
    }

    pub(super) fn put(&mut self, address: usize, bytes: &[u8]) {
        self.memory[address..address + bytes.len()].copy_from_slice(bytes);
    }

    /// Start, length and activation of a sync manager.
    pub(super) fn sync_manager(&self, number: usize) -> (usize, usize, bool) {
        let register = 0x800 + 8 * number;
        (self.u16_at(register).into(), self.u16_at(register + 2).into(), self.memory[register + 6] & 1 == 1)
    }

    /// The bus reads memory; whether the device takes part.
    pub(super) fn read(&mut self, now_ns: u64, address: usize, out: &mut [u8], is_broadcast: bool) -> bool {
        let end = address + out.len();
        if end > MEMORY {
            return false;
        }
        let (start, length, is_active) = self.sync_manager(1);
        let mut is_emptied = false;
        if is_active && (start..start + length).contains(&address) {
            if self.memory[0x80d] & 8 == 0 {
                return false;
            }
            if end >= start + length {
                self.memory[0x80d] &= !8;
                is_emptied = true;
            }
        }
        if (0x910..0x918).contains(&address) {
            let system_ns = self.clock.system_ns(now_ns);
            self.put(0x910, &system_ns.to_le_bytes());
        }
        for (out, byte) in out.iter_mut().zip(&self.memory[address..end]) {
            *out = byte | if is_broadcast { *out } else { 0 };
        }
        if let Some(response) = self.waiting_response.take_if(|_| is_emptied) {
            self.fill_mailbox(&response);
        }
        true
    }

    /// The bus writes memory; whether the device takes part.
    pub(super) fn write(&mut self, now_ns: u64, address: usize, data: &[u8]) -> bool {
        let end = address + data.len();
        if end > MEMORY {
            return false;
        }
        match address {
            // Read only.
            0x000..0x010 | 0x110..0x112 | 0x130..0x136 => return true,
            0x420 if self.is_watchdog_fixed => return true,
            0x900 => {
                self.latch_receive_times(now_ns);
                return true;
            }
            0x910 => {
                self.receive_system_time(now_ns, data);
                return true;
            }
            _ => {}
        }
        let (start, length, is_active) = self.sync_manager(0);
        let is_mailbox = is_active && (start..start + length).contains(&address);
        if is_mailbox && self.memory[0x805] & 8 != 0 {
            return false;
        }
        self.put(address, data);
        let covers = |byte: usize| (address..end).contains(&byte);
        if covers(0x120) {
            self.request_state();
        }
        if covers(0x503) {
            self.read_eeprom();
        }
        if covers(0x920) {
            self.clock.set_offset(self.u64_at(0x920) as i64);
        }
        if covers(0x981) {
            self.start_sync0(now_ns);
        }
        if is_mailbox && covers(start + length - 1) {
            self.receive_mailbox();
        }
        let (start, length, is_active) = self.sync_manager(2);
        if is_active && length > 0 && covers(start + length - 1) {
            self.outputs_ns = Some(now_ns);
            self.memory[0x440] = 1;
        }
        true
    }

    fn latch_receive_times(&mut self, now_ns: u64) {
        let local_ns = self.clock.local_ns(now_ns);
        self.put(0x900, &(local_ns as u32).to_le_bytes());
        self.put(0x904, &(local_ns as u32).wrapping_add(600).to_le_bytes());
        self.put(0x918, &local_ns.to_le_bytes());
    }

    fn receive_system_time(&mut self, now_ns: u64, data: &[u8]) {
        let Ok(bytes) = data.try_into() else { return };
        // The main device clears the register at its start.
        if let reference_ns @ 1.. = u64::from_le_bytes(bytes) {
            let difference_ns = self.clock.steer(reference_ns, now_ns);
            let magnitude = difference_ns.unsigned_abs().min(0x7fff_ffff) as u32;
            let sign = u32::from(difference_ns < 0) << 31;
            self.put(0x92c, &(sign | magnitude).to_le_bytes());
        }
    }

    fn start_sync0(&mut self, now_ns: u64) {
        let (start_ns, cycle_ns) = (self.u64_at(0x990), u64::from(self.u32_at(0x9a0)));
        let is_active = self.memory[0x981] & 3 == 3 && cycle_ns > 0;
        let system_ns = self.clock.system_ns(now_ns);
        let missed = system_ns.saturating_sub(start_ns).div_ceil(cycle_ns.max(1));
        self.next_sync0_ns = is_active.then(|| start_ns + missed * cycle_ns);
    }

    pub(super) fn u32_at(&self, address: usize) -> u32 {
        u32::from(self.u16_at(address)) | u32::from(self.u16_at(address + 2)) << 16
    }

    fn read_eeprom(&mut self) {
        if self.memory[0x503] & 1 != 0 {
            let address = 2 * self.u32_at(0x504) as usize;
            for i in 0..4 {
                self.memory[0x508 + i] = self.sii.get(address + i).copied().unwrap_or(0xff);
            }
        }
        self.memory[0x503] = 0;
    }

    /// Instant of the next cycle of the firmware \[ns\].
    pub fn due_ns(&self, now_ns: u64) -> u64 {
        self.next_sync0_ns.map_or(self.next_free_run_ns, |sync0_ns| self.clock.instant_of(sync0_ns, now_ns))
    }

    /// One cycle of the firmware: outputs act, the encoder is latched into the inputs.
    pub fn cycle(&mut self, now_ns: u64, length_m: f64) {
        let cycle_ns = u64::from(self.u32_at(0x9a0)).max(1);
        match &mut self.next_sync0_ns {
            Some(sync0_ns) => *sync0_ns += cycle_ns,
            None => self.next_free_run_ns = now_ns + FREE_RUN_NS,
        }
        if self.is_op_requested && self.outputs_ns.is_some() {
            (self.memory[0x130], self.is_op_requested) = (OP, false);
        }
        self.check_watchdog(now_ns);
        let is_op = self.memory[0x130] == OP;
        if is_op {
            let (start, length, _) = self.sync_manager(2);
            self.objects.load(&self.outputs, &self.memory[start..(start + length).min(MEMORY)]);
        }
        let outputs = |sub| self.objects.value((objects::DIGITAL_OUTPUTS, sub));
        let command = DriveCommand {
            control_word: if is_op { self.objects.get(objects::CONTROL_WORD) as u16 } else { 0 },
            mode: self.objects.get(objects::MODE) as i8,
            target_torque: self.objects.get(objects::TARGET_TORQUE) as i16,
            max_torque: self.objects.get(objects::MAX_TORQUE) as u16,
            is_brake_set: outputs(1) & outputs(2) & 1 == 1,
        };
        self.drive.cycle(now_ns, command);
        self.latch_inputs(length_m);
        if is_op {
            self.send_emergency();
        }
    }

    fn latch_inputs(&mut self, length_m: f64) {
        let drive = &self.drive;
        let counts = self.model.units.counts(length_m);
        let range = 1 << self.model.units.position_bits;
        let position = if self.is_encoder_reversed { -counts } else { counts }.rem_euclid(range);
        for (index, value) in [
            (objects::STATUS_WORD, u64::from(drive.status_word())),
            (objects::POSITION, u64::from(position as u32)),
            (objects::ACTUAL_TORQUE, u64::from(drive.torque as u16)),
            (objects::ERROR_CODE, u64::from(drive.error_code)),
            (objects::MODE_DISPLAY, u64::from(drive.mode as u8)),
            (objects::DIGITAL_INPUTS, u64::from(drive.digital_inputs())),
        ] {
            self.objects.set(index, value);
        }
        if self.memory[0x130] & 0xf >= SAFE_OP {
            let (start, length, _) = self.sync_manager(3);
            self.objects.store(&self.inputs, &mut self.memory[start..(start + length).min(MEMORY)]);
        }
    }

    /// Force of the drive on its leg \[N\], and the largest of its brake.
    pub fn leg_force(&self) -> LegForce {
        LegForce {
            drive_n: f64::from(self.drive.torque) * self.model.units.newtons_per_permille(),
            brake_n: if self.drive.is_brake_open { 0.0 } else { self.brake_n },
        }
    }
}
