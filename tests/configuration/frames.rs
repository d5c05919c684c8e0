//! Named frames: where they go, and what is said of wrong ones.

use core::f64::consts::FRAC_PI_2;

use hexad::config::Config;
use hexad::config::changes::changes;
use hexad::config::frames::FrameKind;
use nalgebra::{Matrix3, Vector3};

use super::{FRIED, messages};

const FRAMES: &str = "[[frame]]\nname = 'vertex'\nkind = 'tool'\npose = [0, 0, 0, 0, 0, 0.35]\n\
                      [[frame]]\nname = \"optics\"\nkind = \"work\"\npose = [0, 0, 1.5707963267948966, 1, 2, 3]\n";

fn with(frames: &str) -> String {
    FRIED.to_owned() + frames
}

#[test]
fn frames_are_found_by_name_and_kind() {
    let config = Config::parse(&with(FRAMES), "a test").unwrap();
    let [vertex, optics] = config.frames.as_slice() else { panic!("{:?}", config.frames) };
    assert_eq!((vertex.name.as_str(), vertex.kind, vertex.x[5]), ("vertex", FrameKind::Tool, 0.35));
    assert_eq!((optics.kind, optics.x), (FrameKind::Work, [0.0, 0.0, FRAC_PI_2, 1.0, 2.0, 3.0]));
    let frames = config.frames_named(Some("vertex"), Some("optics")).unwrap();
    assert_eq!(frames.tool.position, Vector3::new(0.0, 0.0, 0.35));
    let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    assert!((frames.work.rotation - quarter).amax() < 1e-15);
    assert_eq!(config.frames_named(None, None).unwrap(), Default::default());
    // Of the other kind, and none: both are named, with what there is.
    let error = config.frames_named(Some("optics"), Some("table")).unwrap_err().to_string();
    assert_eq!(
        error,
        "a test: no tool frame \"optics\", must be one of: vertex; add a [[frame]], or use hexad frame set\n\
         a test: no work frame \"table\", must be one of: optics; add a [[frame]], or use hexad frame set"
    );
}

#[test]
fn every_mistake_is_named_at_once() {
    let long = "[[frame]]\nname = 'seventeen_letters'\nkind = 'tol'\npose = [0, 0, 90, 0, 0, 0.35]\n\
                [[frame]]\nkind = 'tool'\npose = [0, 0, 0]\nx = 1\n[[frame]]\nname = 'vertex'\n";
    assert_eq!(
        messages(&with(&(FRAMES.to_owned() + long))),
        [
            "frame[3].name = 'seventeen_letters': must be a name of 1 to 16 characters, each one of A-Z a-z 0-9 _ -",
            "frame[3].kind = 'tol': must be one of \"tool\", \"work\"",
            "frame[3].pose = [0, 0, 90, 0, 0, 0.35]: must have angles in [-2 pi, 2 pi]: alpha, beta, gamma [rad], then x, y, z [m]",
            "frame[4].name: missing, must be a name of 1 to 16 characters, each one of A-Z a-z 0-9 _ -",
            "frame[4].pose = [0, 0, 0]: must be an array of 6 numbers",
            "frame[4].x = 1: unknown key, must be one of: name, kind, pose",
            "frame[5].kind: missing, must be one of \"tool\", \"work\"",
            "frame[5].pose: missing, must be an array of 6 numbers",
            "frame[5].name = 'vertex': must differ from the name of frame[1]",
        ]
    );
    assert_eq!(messages(&format!("frame = 3\n{FRIED}")), ["frame = 3: must be sections headed [[frame]]"]);
}

/// The daemon does not read frames, so there is nothing to reload and no reason to restart.
#[test]
fn a_changed_frame_is_no_change_for_the_daemon() {
    assert_eq!(changes(FRIED, &with(FRAMES)), []);
}
