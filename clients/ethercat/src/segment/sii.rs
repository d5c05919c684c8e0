//! Content of a simulated device's EEPROM: the subdevice information interface (SII), ETG1000.6 chapter 5.4.

use crate::identity::Identity;

/// Receive mailbox, send mailbox, outputs, inputs: start address of each sync manager.
pub const SYNC_MANAGER_STARTS: [u16; 4] = [0x1000, 0x1080, 0x1100, 0x1400];
/// Length of each mailbox.
pub const MAILBOX_LENGTH: u16 = 128;

const CATEGORY_STRINGS: u16 = 10;
const CATEGORY_GENERAL: u16 = 30;
const CATEGORY_FMMU: u16 = 40;
const CATEGORY_SYNC_MANAGERS: u16 = 41;
const NAME: &[u8] = b"HEXAD-SIM";

fn category(content: &mut Vec<u8>, kind: u16, mut data: Vec<u8>) {
    data.resize(data.len().next_multiple_of(2), 0);
    content.extend(kind.to_le_bytes());
    content.extend((data.len() as u16 / 2).to_le_bytes());
    content.extend(data);
}

/// The words of the EEPROM.
pub fn content(identity: Identity) -> Vec<u8> {
    let mut words = [0u16; 0x40];
    let [receive, send, ..] = SYNC_MANAGER_STARTS;
    for (first, value) in
        [(0x08, identity.vendor), (0x0a, identity.product), (0x0c, 1), (0x0e, identity.serial)]
    {
        (words[first], words[first + 1]) = (value as u16, (value >> 16) as u16);
    }
    // Mailboxes, their protocol (CoE), size of the EEPROM, version.
    for (word, value) in [
        (0x18, receive),
        (0x19, MAILBOX_LENGTH),
        (0x1a, send),
        (0x1b, MAILBOX_LENGTH),
        (0x1c, 4),
        (0x3e, 15),
        (0x3f, 1),
    ] {
        words[word] = value;
    }
    let mut content: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    category(&mut content, CATEGORY_STRINGS, [&[1, NAME.len() as u8], NAME].concat());
    let mut general = vec![0; 32];
    // Group and name are string 1; CoE has SDO, PDO assignment and PDO mapping.
    (general[2], general[3], general[5]) = (1, 1, 0x0d);
    category(&mut content, CATEGORY_GENERAL, general);
    // Outputs, inputs, state of the mailbox.
    category(&mut content, CATEGORY_FMMU, vec![1, 2, 3, 0]);
    let lengths = [MAILBOX_LENGTH, MAILBOX_LENGTH, 0, 0];
    let controls = [0x26, 0x22, 0x64, 0x20];
    let mut managers = vec![];
    for (usage, ((start, length), control)) in
        (1u8..).zip(SYNC_MANAGER_STARTS.iter().zip(lengths).zip(controls))
    {
        managers.extend(start.to_le_bytes());
        managers.extend(length.to_le_bytes());
        managers.extend([control, 0, 1, usage]);
    }
    category(&mut content, CATEGORY_SYNC_MANAGERS, managers);
    content.extend([0xff; 8]);
    content
}
