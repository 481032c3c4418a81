//! Figures of throws among obstacles: one catch in the map.

use maud::{Markup, html};

use super::ObstaclesReport;
use super::scene::Scene;
use crate::error::TrialError;
use crate::series::{Series, SeriesReport};
use crate::throw_config::{Mapping, ThrowConfig};
use crate::throw_outcome::ThrowOutcome;
use tactnet_plot::report::{captioned, legend};

/// Returns the figures of the most instructive throw of a series; nothing without throws.
///
/// # Errors
/// Same as the series, because the drawn throw is simulated again.
pub(in crate::series) fn scene_figures(
    series: &Series,
    report: &SeriesReport,
    obstacles: &ObstaclesReport,
) -> Result<Markup, TrialError> {
    let Some(number) = telling(report, obstacles) else {
        return Ok(html! {});
    };
    let config = ThrowConfig {
        mapping: Mapping::Depth,
        ..series.config.clone()
    };
    let trace = Series { config, ..*series }.again(number, 0.0)?;
    let scene = Scene::of(&trace, &series.config.robot);
    Ok(scene.map_or_else(|| html! {}, |scene| draw(number, &scene)))
}

/// Returns the most instructive throw: caught without contact with the map, contact without it, both arms lowered.
/// Otherwise the throw with most of these properties, or the first.
fn telling(report: &SeriesReport, obstacles: &ObstaclesReport) -> Option<u64> {
    let without = obstacles.without_map.as_ref();
    let worth = |outcome: &&ThrowOutcome| {
        let good = !outcome.touched() && outcome.all_caught();
        let blind = without.is_some_and(|without| without.touched.contains(&outcome.number));
        let lowered = outcome
            .obstacles
            .is_some_and(|among| among.arms_held_up == 0);
        (good, good && blind, good && lowered)
    };
    // The first of several equal throws.
    let best = report.outcomes.iter().rev().max_by_key(worth)?;
    Some(best.number)
}

fn draw(number: u64, scene: &Scene) -> Markup {
    let millimetres = |clearance: f64| format!("{:.0} mm", 1e3 * clearance);
    let legend = legend(&["ball", "arms, as spheres", "what truly stands there"]);
    html! {
        h2 { "Throw " (number) }
        p {
            "When the ball is nearest to the hand, the arms are " (millimetres(scene.clearance)) " from what the map shows"
            @if let Some(clearance) = scene.true_clearance {
                ", and " (millimetres(clearance)) " from what truly stands there"
            }
            ". Grey: obstacles of the map. What the camera saw only from behind counts as an obstacle."
        }
        (captioned(
            &scene.plan_view(),
            "From above, cut through what the map shows nearest to the arms. Boxes and arms are darker where the cut goes through them.",
        ))
        (legend)
        (captioned(&scene.side_view(), "From the side, cut through the same place."))
        (legend)
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching::Robot;
    use tactnet_catching_world::{DepthConfig, ObstaclesConfig, WorldConfig};

    use super::*;
    use crate::series::series_page;
    use tactnet_plot::report::assert_page;

    fn series(throws: u64) -> Series {
        let world = WorldConfig {
            obstacles: ObstaclesConfig::table_and_box(),
            // A sixth of the camera's width and height.
            depth: DepthConfig {
                width: 136,
                height: 102,
                focal: DepthConfig::default().focal / 6.0,
                ..DepthConfig::default()
            },
            ..WorldConfig::default()
        };
        Series {
            config: ThrowConfig {
                perfect_perception: true,
                mapping: Mapping::Depth,
                ..ThrowConfig::new(Robot::nominal(), world)
            },
            throws,
            seed: 1,
        }
    }

    #[test]
    fn the_page_of_a_series_shows_both_and_a_cut_through_the_map() {
        let series = series(1);
        let report = series.run_with_and_without_map(|| ()).unwrap();
        let page = series_page(&series, &report).unwrap();
        assert_page(&page);
        for expected in [
            "obstacles touched in",
            "without the map: touched in",
            "<h2>Throw 0</h2>",
            "inside an obstacle",
            "to the right of the robot [m]",
        ] {
            assert!(page.contains(expected), "{expected}");
        }
        // Two arms from above and from the side.
        assert!(page.matches("<circle").count() >= 4 * 21);
        // The JSON output stays small.
        let json = serde_json::to_string(&report).unwrap();
        assert!(json.len() < 4000 && !json.contains("\"touched\""), "{json}");
        assert!(page.len() < 1_500_000, "{}", page.len());
    }

    #[test]
    fn the_throw_that_is_drawn_is_one_that_the_map_saved() {
        let series = series(1);
        let mut report = series.run_with_and_without_map(|| ()).unwrap();
        let mut obstacles = report.obstacles.clone().unwrap();
        let template = report.outcomes[0].clone();
        report.outcomes = (0..4)
            .map(|number| {
                let mut outcome = template.clone();
                outcome.number = number;
                // Without balls, all thrown balls are caught.
                outcome.balls.clear();
                if let Some(among) = &mut outcome.obstacles {
                    among.contacts.ticks = u64::from(number == 0);
                    among.arms_held_up = usize::from(number == 1);
                }
                outcome
            })
            .collect();
        let touched = |obstacles: &mut ObstaclesReport, numbers: &[u64]| {
            obstacles.without_map.as_mut().unwrap().touched = numbers.to_vec();
        };
        touched(&mut obstacles, &[0, 2]);
        assert_eq!(telling(&report, &obstacles), Some(2));
        touched(&mut obstacles, &[0, 1]);
        assert_eq!(telling(&report, &obstacles), Some(1));
        // Both arms are lowered; the first of equal throws wins.
        touched(&mut obstacles, &[]);
        assert_eq!(telling(&report, &obstacles), Some(2));
        touched(&mut obstacles, &[1, 3]);
        assert_eq!(telling(&report, &obstacles), Some(3));
        report.outcomes.truncate(1);
        assert_eq!(telling(&report, &obstacles), Some(0));
        report.outcomes.clear();
        assert_eq!(telling(&report, &obstacles), None);
    }
}
