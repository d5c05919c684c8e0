//! What was measured against cyclictest, and its files.

use super::contest::{Contestant, HISTOGRAM_NS, Round};
use super::distribution::{Distribution, us};
use super::support::Failure;
use super::support::charts::Charts;

/// Curves of the chart.
pub const DISTRIBUTIONS: &str = "loop_latency_distribution.csv";

/// A wake-up later than this is a miss, or later than half a period if that is less: the daemon's default
/// of `late_wakeup_us` \[ns\].
pub const LATE_NS: u64 = 200_000;

/// Quantiles in the files.
const QUANTILES: [(&str, f64); 4] = [("p50", 0.5), ("p99", 0.99), ("p999", 0.999), ("p9999", 0.9999)];

/// All rounds of a contestant at a rate under a load.
pub struct Row {
    pub rate_hz: u32,
    pub loaded: bool,
    pub contestant: Contestant,
    /// With a polling subscriber.
    pub seen: bool,
    pub rounds: Vec<Round>,
}

impl Row {
    pub fn load(&self) -> &'static str {
        if self.loaded { "stress-ng" } else { "idle" }
    }

    /// As in a list.
    pub fn name(&self) -> String {
        let seen = if self.seen { " with a subscriber" } else { "" };
        format!("{} Hz, {}, {}{seen}", self.rate_hz, self.load(), self.contestant.name())
    }

    /// Whether two rows are rounds of one comparison.
    pub fn compares_with(&self, other: &Self) -> bool {
        (self.rate_hz, self.loaded, self.seen) == (other.rate_hz, other.loaded, other.seen)
    }

    fn period_ns(&self) -> u64 {
        1_000_000_000 / u64::from(self.rate_hz)
    }

    /// Of all rounds together.
    pub fn pooled(&self, pick: fn(&Round) -> &Distribution) -> Distribution {
        let mut pooled = Distribution::default();
        self.rounds.iter().for_each(|round| pooled.merge(pick(round)));
        pooled
    }

    /// The median over the rounds of a quantile \[us\]; `None` where nothing was measured.
    pub fn quantile_us(&self, pick: fn(&Round) -> &Distribution, q: f64) -> Option<f64> {
        let quantiles = self.sorted_us(pick, q);
        let middle = quantiles.len().checked_sub(1)? / 2;
        Some(0.5 * (quantiles.get(middle)? + quantiles.get(quantiles.len() / 2)?))
    }

    /// A quantile of every round \[us\], the least first.
    fn sorted_us(&self, pick: fn(&Round) -> &Distribution, q: f64) -> Vec<f64> {
        let measured = self.rounds.iter().map(pick).filter(|round| round.count() > 0);
        let mut quantiles: Vec<_> = measured.map(|round| us(round.quantile(q))).collect();
        quantiles.sort_by(f64::total_cmp);
        quantiles
    }

    /// p99 of the wake-up latency in the best round \[us\]: the one that others disturbed least.
    pub fn best_p99_us(&self) -> f64 {
        self.sorted_us(|round| &round.wakeup, 0.99).first().copied().unwrap_or(f64::NAN)
    }

    pub fn p99_us(&self) -> f64 {
        self.quantile_us(|round| &round.wakeup, 0.99).unwrap_or(f64::NAN)
    }

    /// Beyond this a wake-up is a miss.
    pub fn late_ns(&self) -> u64 {
        late_ns(self.rate_hz)
    }

    pub fn late(&self) -> u64 {
        self.pooled(|round| &round.wakeup).later_than(self.late_ns())
    }

    /// Wake-ups so late that the release after them had passed. Where the period is longer than cyclictest's
    /// histogram, those beyond its end.
    pub fn lost(&self) -> u64 {
        self.pooled(|round| &round.wakeup).later_than(self.period_ns().min(HISTOGRAM_NS) - 1)
    }

    fn sum(&self, pick: fn(&Round) -> u64) -> u64 {
        self.rounds.iter().map(pick).sum()
    }
}

/// Beyond this a wake-up at a rate is a miss.
pub fn late_ns(rate_hz: u32) -> u64 {
    LATE_NS.min(500_000_000 / u64::from(rate_hz))
}

/// The row of a contestant, without a subscriber.
pub fn find(rows: &[Row], rate_hz: u32, loaded: bool, contestant: Contestant) -> Option<&Row> {
    rows.iter().find(|row| {
        (row.rate_hz, row.loaded, row.contestant, row.seen) == (rate_hz, loaded, contestant, false)
    })
}

/// One line per row: quantiles are medians over the rounds, p9999 and max are of all rounds together.
pub fn write_csv(charts: &Charts, rows: &[Row]) -> Result<(), Failure> {
    let names = |stem: &str| QUANTILES.map(|(quantile, _)| format!("{stem}_{quantile}_us"));
    let mut header: Vec<String> =
        ["rate_hz", "load", "contestant", "subscriber", "rounds", "cycles"].map(String::from).into();
    header.extend(names("wakeup"));
    header.extend(
        [
            "wakeup_max_us",
            "wakeup_best_p99_us",
            "wakeup_p99_over_cyclictest",
            "late",
            "lost",
            "overruns",
            "forces_sent",
            "unrecorded",
        ]
        .map(String::from),
    );
    for stem in ["compute", "end_to_end", "visible"] {
        header.extend(names(stem));
    }
    header.push("steal_ms".into());
    let header: Vec<_> = header.iter().map(String::as_str).collect();
    charts.write_csv("loop_latency.csv", &header, rows.iter().map(|row| record(row, rows)))
}

fn record(row: &Row, rows: &[Row]) -> Vec<String> {
    let wakeup = row.pooled(|round| &round.wakeup);
    let ratio = ratio(row, rows).map_or(String::new(), |ratio| format!("{ratio:.3}"));
    let mut record = vec![
        row.rate_hz.to_string(),
        row.load().into(),
        row.contestant.name().into(),
        u8::from(row.seen).to_string(),
        row.rounds.len().to_string(),
        wakeup.count().to_string(),
    ];
    let quantiles = |pick| {
        QUANTILES.map(|(name, q)| {
            let pooled = || Some(row.pooled(pick)).filter(|it| it.count() > 0).map(|it| us(it.quantile(q)));
            let value = if name == "p9999" { pooled() } else { row.quantile_us(pick, q) };
            value.map_or(String::new(), |value| format!("{value:.2}"))
        })
    };
    record.extend(quantiles(|round| &round.wakeup));
    record.push(format!("{:.1}", us(wakeup.max())));
    record.push(format!("{:.2}", row.best_p99_us()));
    record.extend([ratio, row.late().to_string(), row.lost().to_string()]);
    record.extend(match row.contestant {
        Contestant::Cyclictest => [const { String::new() }; 3],
        Contestant::Hexad(_) => {
            let sent = |round: &Round| round.end_to_end.count();
            [row.sum(|round| round.overruns), row.sum(sent), row.sum(|round| round.unrecorded)]
                .map(|sum| sum.to_string())
        }
    });
    record.extend(quantiles(|round| &round.compute));
    record.extend(quantiles(|round| &round.end_to_end));
    record.extend(quantiles(|round| &round.visible));
    record.push(row.sum(|round| round.steal_ms).to_string());
    record
}

/// p99 of the wake-up latency over cyclictest's.
pub fn ratio(row: &Row, rows: &[Row]) -> Option<f64> {
    let theirs = find(rows, row.rate_hz, row.loaded, Contestant::Cyclictest)?;
    let comparable = row.contestant != Contestant::Cyclictest && !row.seen;
    comparable.then(|| row.p99_us() / theirs.p99_us())
}

/// `rate_hz, load, contestant, latency_us, share_later`: the curves of the chart.
pub fn write_distributions(charts: &Charts, rows: &[Row]) -> Result<(), Failure> {
    let header = ["rate_hz", "load", "contestant", "latency_us", "share_later"];
    let records = rows.iter().filter(|row| !row.seen).flat_map(|row| {
        let curve = row.pooled(|round| &round.wakeup).curve();
        curve.into_iter().map(|(latency_us, share)| {
            let [latency_us, share] = [format!("{latency_us:.3}"), format!("{share:.3e}")];
            [row.rate_hz.to_string(), row.load().into(), row.contestant.name().into(), latency_us, share]
        })
    });
    charts.write_csv(DISTRIBUTIONS, &header, records)
}
