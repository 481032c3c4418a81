//! HTML page of throws among obstacles: with and without the map, one catch in the map, times.

use maud::{Markup, html};
use tactnet_plot::{Page, wilson_of_counts};

use super::scene::Scene;
use super::{ObstaclesReport, touched};
use crate::error::TrialError;
use crate::page_parts::{captioned, counts_table, legend, percent, table};
use crate::series::{Series, SeriesReport};
use crate::throw_config::{Mapping, ThrowConfig};
use crate::throw_outcome::{BallOutcome, ThrowOutcome};

/// Goal for the time from depth pictures to plans, in ms.
const GOAL_MS: f64 = 1000.0;

/// Returns a self-contained page.
///
/// - `report`: result of [`Series::run_with_and_without_map`]; if the robot did not look around, the page reports
///   that
///
/// # Errors
/// Same as the series, because the drawn throw is simulated again.
pub fn obstacles_page(series: &Series, report: &SeriesReport) -> Result<String, TrialError> {
    let content = match &report.obstacles {
        Some(obstacles) => content(series, report, obstacles)?,
        None => html! {
            p.headline { "The robot did not look about in any of " (report.throws) " throws." }
        },
    };
    Ok(Page::new("Catching among obstacles", content).to_html())
}

fn content(
    series: &Series,
    report: &SeriesReport,
    obstacles: &ObstaclesReport,
) -> Result<Markup, TrialError> {
    let drawn = telling(report, obstacles)
        .map(|number| {
            let config = ThrowConfig {
                mapping: Mapping::Depth,
                ..series.config.clone()
            };
            let trace = Series { config, ..*series }.again(number)?;
            let scene = Scene::of(&trace, &series.config.robot);
            Ok::<_, TrialError>(scene.map(|scene| draw(number, &scene)))
        })
        .transpose()?
        .flatten();
    Ok(html! {
        (headline(report, obstacles))
        h2 { "With and without the map" }
        (side_by_side(report, obstacles))
        @if let Some(drawn) = drawn { (drawn) }
        (counts_table(["Missed because", "Balls"], &report.misses))
        (counts_table(["Touched deepest by", "Throws"], &obstacles.contact_parts))
    })
}

fn headline(report: &SeriesReport, obstacles: &ObstaclesReport) -> Markup {
    let rate = obstacles.contacts as f64 / report.throws.max(1) as f64;
    html! {
        p.headline {
            "With a map the robot touched something in " (obstacles.contacts) " of " (report.throws) " throws"
            @if let Some(without) = &obstacles.without_map { ", without a map in " (without.contacts_without_map) }
            "; it caught " (report.caught) " of " (report.in_catch_space) " balls in the catch space."
        }
        p {
            "Touched: " (percent(rate, obstacles.contacts_ci95)) ". Caught: "
            (percent(report.rate, [report.ci95_low, report.ci95_high])) ". Intervals are Wilson's, 95 %; seed " (report.seed)
            ". A simulation in stepped time: what stands about is put elsewhere before each throw, the robot looks with a depth camera in "
            "its head, and the same throws are then thrown to a robot that does not look."
        }
    }
}

/// Returns the table of all results, compared with those without the map and the goals.
fn side_by_side(report: &SeriesReport, obstacles: &ObstaclesReport) -> Markup {
    let throws = report.throws;
    let without = obstacles.without_map.as_ref();
    let of = |count: usize, of: usize| {
        let share = count as f64 / of.max(1) as f64;
        let share = percent(share, wilson_of_counts(count, of));
        format!("{count} of {of}: {share}")
    };
    let plans = obstacles.look_to_plan_ms;
    let missing = || "not run".to_string();
    let rows = [
        [
            "Throws in which anything was touched".into(),
            of(obstacles.contacts, throws),
            without.map_or_else(missing, |w| of(w.contacts_without_map, throws)),
            "0 of 500; the thesis has none".into(),
        ],
        [
            "The deepest contact [mm]".into(),
            format!("{:.0}", obstacles.contact_mm_max),
            without.map_or_else(missing, |w| format!("{:.0}", w.contact_mm_max_without_map)),
            "0".into(),
        ],
        [
            "Caught of those in the catch space".into(),
            of(report.caught, report.in_catch_space),
            without.map_or_else(missing, |w| of(w.caught, w.in_catch_space)),
            "reported; the thesis has none".into(),
        ],
        [
            "Caught and nothing touched, of all throws".into(),
            of(obstacles.untouched_catches, throws),
            without.map_or_else(missing, |w| of(w.untouched_catches_without_map, throws)),
            "reported; the thesis has none".into(),
        ],
        [
            "Throws with obstacles in every way of a plan".into(),
            of(obstacles.obstructed, throws),
            "no map, no such plan".into(),
            "reported".into(),
        ],
        [
            "Arms that stayed up, their way down not clear".into(),
            obstacles.arms_held_up.to_string(),
            "no map: none".into(),
            "reported".into(),
        ],
        [
            "Four depth pictures to the first plans of both arms [ms]".into(),
            plans.map_or_else(missing, |ms| {
                let [p50, p99, max] = [ms.p50, ms.p99, ms.max];
                format!("median {p50:.0}, 99 % {p99:.0}, longest {max:.0}")
            }),
            "no map".into(),
            format!("less than {GOAL_MS:.0}; in the thesis 3000, on graphics processors"),
        ],
    ];
    table(["What", "With the map", "Without", "Goal"], &rows)
}

/// Returns the most instructive throw: caught without contact with the map, contact without it, both arms lowered.
/// Otherwise the throw with most of these properties, or the first.
fn telling(report: &SeriesReport, obstacles: &ObstaclesReport) -> Option<u64> {
    let without = obstacles.without_map.as_ref();
    let worth = |outcome: &&ThrowOutcome| {
        let good = !touched(outcome) && outcome.balls.iter().all(BallOutcome::caught);
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
            ". Shades: the map's distance to obstacles, dark inside, none from 30 cm on. What the camera saw only from behind counts as an "
            "obstacle."
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
    use crate::page_parts::tests::assert_page;

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
        let page = obstacles_page(&series, &report).unwrap();
        assert_page(&page);
        let obstacles = report.obstacles.as_ref().unwrap();
        let touched = format!("touched something in {} of 1 throws", obstacles.contacts);
        let without = obstacles.without_map.as_ref().unwrap();
        let blind = format!("without a map in {}", without.contacts_without_map);
        for expected in [
            touched.as_str(),
            blind.as_str(),
            "<h2>Throw 0</h2>",
            "from an obstacle</title>",
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
    fn the_page_of_no_throws_says_so() {
        let series = series(0);
        let report = series.run_with_and_without_map(|| ()).unwrap();
        let page = obstacles_page(&series, &report).unwrap();
        assert_page(&page);
        assert!(page.contains("did not look about in any of 0 throws"));
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
