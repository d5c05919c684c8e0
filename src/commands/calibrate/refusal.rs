//! What a table lacks that is no calibration, and what to do.

use crate::commands::failure::Failure;
use hexad_machine::analysis::calibration::mistakes::Mistake;
use hexad_machine::analysis::calibration::{Refusal, Task};
use hexad_machine::text::numbers::{AXES, readable, significant};
use hexad_machine::text::units::LENGTHS;

/// The refusal as a failure of the command.
pub(super) fn failure(refusal: &Refusal, rows: usize, task: &Task) -> Failure {
    let length = |value_m: f64| readable(value_m, LENGTHS);
    let text = match refusal {
        Refusal::TooFewRows { needed } => format!(
            "{rows} rows: must be {needed} at least with all of the pose, better 40 to 60; hexad calibrate --plan 60 chooses poses"
        ),
        Refusal::NoPose => "the legs of the drawing have no pose with most of these lengths; look at the units and the order of \
                            length_1 to length_6, and whether the drives measure from joint to joint"
            .into(),
        Refusal::Mistake(mistake) => mistake_text(*mistake),
        Refusal::FarFromDrawing { change_m } => format!(
            "joints or offsets would be {} off the drawing, five times --tolerance {} at most; look at the units, the order of the legs and the \
             tracker's frame, or state a larger --tolerance",
            length(*change_m),
            length(task.tolerance_m)
        ),
        Refusal::PoorSpread { directions, position_rms_m: [after, before] } => format!(
            "the poses are too much alike: they determine {} of {} combinations of joints and offsets (condition {}); a position over the \
             workspace would be known to {}, must be a third of the {} by --tolerance at most; hexad calibrate --plan 60 chooses poses",
            directions.determined,
            directions.determined + directions.weak,
            significant(directions.condition),
            length(*after),
            length(*before)
        ),
    };
    Failure::after_start(format_args!("not a calibration: {text}"))
}

fn mistake_text(mistake: Mistake) -> String {
    let unit = |factor: f64| if factor < 1.0 { "millimetres as metres" } else { "metres as millimetres" };
    match mistake {
        Mistake::ExchangedLegs(a, b) => format!(
            "lengths of legs {} and {} are exchanged; with them the other way round the drawing fits",
            a + 1,
            b + 1
        ),
        Mistake::MirroredAxis(axis) => format!(
            "{} of the tracker has the wrong sign; with the other sign the drawing fits",
            AXES.get(3 + axis).copied().unwrap_or_default()
        ),
        Mistake::LeftHanded => "the tracker's frame is left-handed: one of its axes is mirrored; with the other sign of any one axis \
                                (of a probe also of the rotations about the other two) the drawing fits"
            .into(),
        Mistake::LengthUnit(factor) => {
            format!("the table has lengths of the legs in {}; name the columns length_1_mm and so on, or without unit", unit(factor))
        }
        Mistake::TrackerUnit(factor) => {
            format!("the table has positions of the tracker in {}; name the columns x_mm (point_1_x_mm) and so on, or without unit", unit(factor))
        }
    }
}
