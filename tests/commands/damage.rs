//! A recording that has changed since it was written: every command that reads it says so, and `recover` keeps the rest.

use std::fs;

use super::{Folder, has};
use hexad_support::data;

#[test]
fn a_damaged_recording_is_told_and_its_rest_is_recovered() {
    let folder = Folder::new("");
    let mut content = fs::read(data("hexad-2026-11-25", "mcap")).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 4;
    folder.write("run.mcap", content);
    for command in ["convert @/run.mcap --csv @/run.csv", "replay @/run.mcap", "identify @/run.mcap"] {
        let (code, _, errors) = folder.run(command);
        assert!(code.is_some_and(|code| code > 0), "{command}");
        has(&errors, &["/run.mcap: damaged: ", " s; hexad recover --output NEW writes the rest"]);
    }
    assert!(!folder.path("run.csv").exists());
    let (code, text, errors) = folder.run("recover @/run.mcap --output @/rest.mcap");
    assert_eq!(code, Some(0), "{errors}");
    has(&text, &["/rest.mcap: ", " messages; damaged (cycles of these times are left out): ", " s\n"]);
    let (code, text, errors) = folder.run("convert @/rest.mcap --csv @/rest.csv");
    assert_eq!(code, Some(0), "{text}{errors}");
    let (code, text, errors) = folder.run("replay @/rest.mcap");
    assert_eq!(code, Some(0), "{text}{errors}");
    has(&text, &["cycles cannot be repeated, as the memory of the controller is unknown: "]);
    let (_, text, _) = folder.run("recover @/rest.mcap");
    has(&text, &["it is complete"]);
    // Without its end: what a crash leaves.
    let rest = fs::read(folder.path("rest.mcap")).unwrap();
    folder.write("cut.mcap", &rest[..rest.len() * 9 / 10]);
    for command in
        ["convert @/cut.mcap --csv @/cut.csv", "replay @/cut.mcap", "report @/cut.mcap --output @/cut.html"]
    {
        let (code, _, errors) = folder.run(command);
        assert_eq!(code, Some(0), "{command}: {errors}");
        has(&errors, &["/cut.mcap: it is not complete (", "hexad recover completes it"]);
    }
    // A part is unfinished if it has the end; completing the file does not change that.
    folder.execute("recover @/cut.mcap --output @/completed.mcap").unwrap();
    let parts = [("0..0.001", "recording</title>"), ("0..99", "recording, unfinished</title>")];
    for (file, (part, title)) in
        ["cut", "completed"].into_iter().flat_map(|file| parts.map(|part| (file, part)))
    {
        folder.execute(&format!("replay @/{file}.mcap --extract {part} --output @/part.mcap")).unwrap();
        folder.execute("report @/part.mcap --output @/part.html").unwrap();
        assert!(folder.read("part.html").contains(title), "{file} {part}: {title}");
    }
}
