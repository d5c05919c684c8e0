//! Collects what was measured in many runs, prints it, and fails if a limit was exceeded in any.

use std::fmt::Write;

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::parameters::Parameters;
use hexad::control::signals::inputs::Input;
use hexad::model::task::TaskState;
use hexad_support::extremes::{Extremes, Quantity};
use hexad_support::rig::{Rates, Rig};

/// What one test has measured.
pub struct Report {
    name: &'static str,
    lines: String,
    violations: Vec<String>,
}

/// What the runs of one machine have measured.
#[derive(Default)]
pub struct Runs {
    pub count: u32,
    /// Runs in which the platform was taken under control as the test asks for.
    pub accepted: u32,
    pub end_stops: u32,
    pub impact_m_s: f64,
    pub fastest_m_s: f64,
    pub hardest_m_s2: f64,
    pub cycles: u64,
    /// Largest distance from the setpoint \[m\], where it was measured.
    pub distance_m: f64,
    pub extremes: Extremes,
}

impl Runs {
    /// For the next run: each in turn.
    pub fn rates(&self) -> Rates {
        Rates::ALL[self.count as usize % Rates::ALL.len()]
    }

    /// A platform that stands at the start of a motion, engages, and gets an input at each time since then, until an end \[s\] or
    /// until control ends. Returns the last output.
    pub fn play(
        &mut self,
        (config, parameters): (&Config, Parameters),
        motion: &dyn Fn(f64) -> TaskState,
        end_s: f64,
        mut input: impl FnMut(&Rig, f64) -> Input,
    ) -> Output {
        let mut observed = Rig::standing(config, parameters, &motion(0.0));
        observed.rates = self.rates();
        observed.engage(&motion(0.0));
        let (start_s, mut output) = (observed.time_s(), Output::default());
        while observed.time_s() < start_s + end_s {
            output = observed.cycle(&input(&observed, observed.time_s() - start_s));
            if !output.state.has_control() {
                break;
            }
        }
        self.add(&observed);
        output
    }

    pub fn add(&mut self, observed: &Rig) {
        let meter = &observed.meter();
        self.count += 1;
        self.end_stops += u32::from(meter.impact_m_s.is_some());
        self.impact_m_s = self.impact_m_s.max(meter.impact_m_s.unwrap_or_default());
        self.fastest_m_s = self.fastest_m_s.max(meter.fastest_m_s);
        self.hardest_m_s2 = self.hardest_m_s2.max(meter.hardest_m_s2);
        self.cycles += meter.cycles;
        self.extremes.merge(&meter.extremes);
    }
}

impl Report {
    pub fn new(name: &'static str) -> Self {
        Self { name, lines: String::new(), violations: Vec::new() }
    }

    /// Judges the runs of one machine by every limit.
    pub fn add(&mut self, machine: &str, runs: &Runs) {
        self.add_with(machine, runs, Quantity::allowed);
    }

    /// Judges by other bounds: where a limit is a different one.
    pub fn add_with(&mut self, machine: &str, runs: &Runs, allowed: impl Fn(Quantity) -> f64) {
        let Runs { count, accepted, end_stops, impact_m_s, fastest_m_s, hardest_m_s2, .. } = runs;
        let Runs { cycles, distance_m, extremes, .. } = runs;
        assert!(*cycles > 0, "{}: {machine} was never under control", self.name);
        writeln!(
            self.lines,
            "{}: {machine}: {count} runs, {accepted} accepted, {cycles} cycles, {end_stops} end stops (to {impact_m_s:.2} m/s), speed \
             {fastest_m_s:.3} m/s, acceleration {hardest_m_s2:.2} m/s^2, from the setpoint {:.1} mm",
            self.name,
            1e3 * distance_m
        )
        .unwrap();
        for quantity in Quantity::all() {
            let (value, allowed) = (extremes.of(quantity), allowed(quantity));
            if value > allowed {
                let at = extremes.instant_ns(quantity);
                self.violations.push(format!(
                    "{machine}: {} {value:.4} beyond {allowed:.4} at {:.4} s",
                    quantity.name(),
                    (at - hexad_support::rig::START_NS) as f64 * 1e-9
                ));
            }
        }
    }

    /// A bound of this test alone.
    pub fn bound(&mut self, machine: &str, what: &str, value: f64, bound: f64) {
        if !(value <= bound) {
            self.violations.push(format!("{machine}: {what} {value:.4} beyond {bound:.4}"));
        }
    }

    pub fn assert(self) {
        println!("{}", self.lines);
        assert!(self.violations.is_empty(), "{}\n{}", self.lines, self.violations.join("\n"));
    }
}
