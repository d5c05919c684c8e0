//! Screen of `hexad jog`, for 80 columns and 24 lines.

use core::fmt;

use super::jog_pace::{JogPace, Pace};
use super::keys::Key;
use crate::commands::status::screen::{legs, poses};
use hexad_client::operator::protocol::AnswerLine as Answer;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::numbers::{AXES, significant};

/// Content of the screen.
pub struct JogScreen<'a> {
    pub answer: &'a Answer,
    pub pace: &'a JogPace,
    /// The bound that stops the motion; empty without one.
    pub bound: &'a str,
    pub coordinates: &'a Coordinates,
    pub held: Option<Key>,
}

impl fmt::Display for JogScreen<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { answer, pace, bound, coordinates, held } = self;
        let Some(report) = &answer.status else { return writeln!(f, "{}", answer.text) };
        let state = answer.state.to_uppercase();
        writeln!(
            f,
            "{:.80}",
            format!("jog {}   {state}   q ends; the platform then stands under control", report.machine)
        )?;
        let code = answer.diagnostic.code;
        writeln!(f, "{:.80}", if code == 0 { "" } else { &answer.diagnostic.text })?;
        let limits =
            if report.active_limits.is_empty() { "none".into() } else { report.active_limits.join(", ") };
        writeln!(f, "{:.80}", format!("limits    {limits}"))?;
        let bound = if bound.is_empty() { "none" } else { bound.lines().next().unwrap_or_default() };
        writeln!(f, "{:.80}", format!("bound     {bound}"))?;
        poses(f, &coordinates.report(report), &coordinates.label, pace.units)?;
        legs(f, report)?;
        writeln!(f, "\nup/down   x w/s   y e/d   z r/f   alpha t/g   beta y/h   gamma u/j   leave q")?;
        let ([position, angle], per, end) = match pace.pace() {
            Pace::Continuous(velocities) => (velocities, "/s", "while a key is held; m: steps"),
            Pace::Step(steps) => (steps, "", "for each key; m: continuous"),
        };
        let in_unit =
            |x: f64, (unit, factor): (&str, f64)| format!("{} {unit}{per}", significant(x / factor));
        let [position, angle] = [in_unit(position, pace.units.length), in_unit(angle, pace.units.angle)];
        writeln!(f, "pace      +/-  {position}   ./,  {angle}   {end}")?;
        let moving = match held {
            Some(Key::Move { axis, sign }) => {
                format!("{} {}", AXES.get(*axis).unwrap_or(&""), if *sign > 0.0 { "up" } else { "down" })
            }
            _ => "nothing".into(),
        };
        writeln!(f, "moving    {moving}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use crate::commands::status::screen::tests::answer;
    use hexad_machine::config::Config;
    use hexad_machine::text::units::MotionUnits;

    #[test]
    fn it_fits_the_smallest_terminal() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let coordinates = Coordinates::default();
        let pace = &JogPace::new(&config, MotionUnits::default());
        let held = Some(Key::Move { axis: 5, sign: -1.0 });
        let text = JogScreen { answer: &answer(), pace, bound: "leg 1", coordinates: &coordinates, held }
            .to_string();
        let widest = text.lines().map(|line| line.chars().count()).max();
        assert!(text.lines().count() <= 24 && widest <= Some(80), "{text}");
        for words in [
            "STOPPING",
            "force, force rate, stroke",
            "moving    z down",
            "setpoint",
            "1225.000",
            "+/-  20.0 mm/s   ./,  ",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
    }
}
