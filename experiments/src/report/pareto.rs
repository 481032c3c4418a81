//! Mean error against training time.

use maud::{Markup, PreEscaped, html};
use tactnet_plot::{Axes, Axis, Series, escape, figure};

use crate::benchmark::{Benchmark, Condition, ModelScore};

/// Shortest training time on the axis, in seconds.
const LEAST_SECONDS: f64 = 1e-3;

/// A model as a point of the figure.
struct Point<'a> {
    model: &'a str,
    seconds: f64,
    error: f64,
}

/// Returns the figure; `None` without two models on the same data sets.
pub(super) fn section(benchmark: &Benchmark) -> Option<Markup> {
    let scores = benchmark.under(Condition::Headline)?;
    let sets = scores.models.iter().map(|of| of.sets).max()?;
    let everywhere = scores.models.iter().filter(|of| of.sets == sets);
    let points: Vec<Point<'_>> = everywhere.filter_map(point).collect();
    if points.len() < 2 {
        return None;
    }
    let most = points.iter().map(|point| point.error).fold(0.0, f64::max);
    let most = (1.15 * most).max(0.01);
    let step = [0.002, 0.01, 0.02, 0.05, 0.1];
    let step = step.into_iter().find(|step| most / step <= 6.0);
    let vertical = Axis::percent("mean error, %", most, step.unwrap_or(0.2));
    let horizontal = Axis::decades(
        "training time of a fold, s",
        points.iter().map(|point| point.seconds),
    )?;
    let axes = Axes {
        left: 52.0,
        top: 14.0,
        width: 520.0,
        height: 300.0,
        horizontal,
        vertical,
    };
    let mut content = axes.grid();
    let front: Vec<(f64, f64)> = front(&points);
    content.push_str(&axes.path(Series::nth(7), &front));
    for (index, point) in points.iter().enumerate() {
        let (x, y) = (axes.x(point.seconds), axes.y(point.error));
        let series = Series::nth(index);
        content.push_str(&series.group(&series.marker(x, y)));
        content.push_str(&format!(
            "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            x + 7.0,
            y - 5.0,
            escape(point.model)
        ));
    }
    let title = "Mean error of the headline against the mean training time of a fold";
    Some(html! {
        figure {
            (PreEscaped(figure(700.0, 364.0, title, &content)))
            figcaption {
                (title) " over " (sets) " data sets. The line joins the models that no other one beats in both. A committee's time is that of all its "
                "members. The horizontal axis is logarithmic."
            }
        }
    })
}

fn point(of: &ModelScore) -> Option<Point<'_>> {
    Some(Point {
        model: &of.model,
        seconds: of.train_seconds?.max(LEAST_SECONDS),
        error: of.mean_error?,
    })
}

/// Returns time and error of the models that no other one beats in both, the fastest first.
fn front(points: &[Point<'_>]) -> Vec<(f64, f64)> {
    let mut by_time: Vec<&Point<'_>> = points.iter().collect();
    by_time.sort_by(|a, b| {
        (a.seconds, a.error)
            .partial_cmp(&(b.seconds, b.error))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let mut front: Vec<(f64, f64)> = Vec::new();
    for point in by_time {
        if front.last().is_none_or(|(_, least)| point.error < *least) {
            front.push((point.seconds, point.error));
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::tests::of_accuracies;

    #[test]
    fn the_front_holds_what_no_other_model_beats_in_both() {
        let of = |seconds, error| Point {
            model: "m",
            seconds,
            error,
        };
        let points = [
            of(10.0, 0.02),
            of(1.0, 0.05),
            of(5.0, 0.06),
            of(1.0, 0.07),
            of(20.0, 0.02),
        ];
        assert_eq!(front(&points), [(1.0, 0.05), (10.0, 0.02)]);
    }

    #[test]
    fn models_that_are_left_out_somewhere_have_no_point() {
        let drawn = |third| {
            let sets: [(&str, &[Option<f64>]); 2] = [
                ("felt", &[Some(0.9), Some(0.8), third]),
                ("cork", &[Some(0.7), Some(0.75), Some(0.6)]),
            ];
            let page = section(&of_accuracies(&sets)).unwrap().into_string();
            page.matches("class=\"series").count()
        };
        // One for each model, and the line.
        assert_eq!((drawn(Some(0.5)), drawn(None)), (4, 3));
    }
}
