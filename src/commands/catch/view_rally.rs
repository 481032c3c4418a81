//! Flights of a rally in the Rerun viewer.

use tactnet_catching_trials::{RallyFlight, RallyReport};
use tactnet_recording::view::{Lines, Motion, Target, show_motion};

/// Shows flights from their releases on, one behind the other.
pub fn view(report: &RallyReport, target: &Target) -> anyhow::Result<()> {
    let way = |flight: &RallyFlight| {
        let aside = 0.1 * flight.game as f64;
        let path = flight.path.iter();
        path.map(|[along, height]| [*along, aside, *height])
            .collect()
    };
    let lines = |name: &str, caught: bool| Lines {
        name: name.into(),
        strips: report
            .flights
            .iter()
            .filter(|flight| flight.caught == caught)
            .map(way)
            .collect(),
    };
    let motion = Motion {
        lines: vec![lines("missed", false), lines("caught", true)],
        ..Motion::default()
    };
    Ok(show_motion(target, "rally", &motion)?)
}
