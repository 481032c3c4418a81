//! Paired comparisons of methods on the same tasks, and the sweeps that transfer saves.

use maud::{Markup, html};

use super::super::table::{Heading, body, count, number, plain, sortable};
use super::super::text::{ABSENT, decimal, p_value, percent, scroll};
use crate::comparison::name_in_comparison;
use crate::{SampleEfficiency, Summary};

/// Returns the table of paired comparisons.
pub(super) fn comparisons(study: &Summary) -> Markup {
    let pairs = study.comparisons.iter().filter_map(|comparison| {
        Some((
            comparison,
            study.row(&comparison.first)?,
            study.row(&comparison.second)?,
        ))
    });
    let interval = |ci95: Option<[f64; 2]>| match ci95 {
        Some([low, high]) => format!(
            "[{}, {}]",
            decimal(100.0 * low, 1),
            decimal(100.0 * high, 1)
        ),
        None => ABSENT.into(),
    };
    let rows = html! {
        @for (comparison, first, second) in pairs {
            @let points = 100.0 * comparison.difference;
            tr {
                td { (first.data) @if first.model == second.model { ", networks by " (first.model) } }
                td { (first.levels.name()) }
                td { (first.measure.name()) }
                td { (first.setting) }
                (count(first.shots))
                (count(first.sweeps))
                td { (name_in_comparison(first, second)) }
                td { (name_in_comparison(second, first)) }
                (number(Some(points), &decimal(points, 1)))
                (number(comparison.ci95.map(|ends| ends[0]), &interval(comparison.ci95)))
                (number(comparison.p, &p_value(comparison.p)))
                (number(comparison.p_holm, &p_value(comparison.p_holm)))
                (count(Some(comparison.n)))
            }
        }
    };
    let headings = [
        Heading::text("Data"),
        Heading::text("Levels"),
        Heading::text("Measure"),
        Heading::text("Setting"),
        Heading::number("Shots", ""),
        Heading::number("Sweeps", ""),
        Heading::text("First"),
        Heading::text("Second"),
        Heading::number("First \u{2212} second", "points"),
        Heading::number("95 % interval", ""),
        Heading::number("p", ""),
        Heading::number("p, Holm", ""),
        Heading::number("Tasks", ""),
    ];
    let caption = "Differences on the same tasks";
    html! {
        p {
            "Differences on the same tasks. p is two-sided, and after Holm's correction for all comparisons of a measure on one "
            "data set."
        }
        (sortable("Paired comparisons", "", caption, &headings, &body(None, 0, &rows)))
    }
}

/// Returns the table of sweeps that transfer saves.
pub(super) fn efficiency(efficiency: &[SampleEfficiency]) -> Markup {
    let published = efficiency
        .iter()
        .any(|found| found.published_ratio.is_some());
    let shots =
        |value: Option<f64>| value.map_or("more than tested".into(), |value| decimal(value, 1));
    let interval = |ci95: Option<[Option<f64>; 2]>| {
        ci95.map_or(ABSENT.into(), |[low, high]| {
            format!("{} to {}", shots(low), shots(high))
        })
    };
    let ratio = |found: &SampleEfficiency| {
        let ratio = found.shots.map(|shots| shots / found.transfer_shots as f64);
        ratio.map_or(ABSENT.into(), |ratio| decimal(ratio, 1))
    };
    let rows = html! {
        @for found in efficiency {
            tr {
                td { (found.data) ", networks by " (found.model) }
                td { (found.levels.name()) }
                td.number { (found.transfer_shots) }
                td.number { (percent(found.accuracy)) }
                td.number { (shots(found.shots)) }
                td.number { (interval(found.ci95)) }
                td.number { (ratio(found)) }
                @if published {
                    @let shown = found.published_ratio.map(|ratio| decimal(ratio, 0));
                    (number(found.published_ratio, &shown.unwrap_or_default()))
                }
            }
        }
    };
    let mut headings = vec![
        Heading::text("Data"),
        Heading::text("Levels"),
        Heading::number("Shots of transfer", ""),
        Heading::number("Its accuracy, %", ""),
        Heading::number("Shots from scratch", ""),
        Heading::number("95 % interval", ""),
        Heading::number("Ratio", ""),
    ];
    if published {
        headings.push(Heading::number("Published ratio", ""));
    }
    html! {
        p {
            "Sweeps of each new material that a network from scratch needs to reach the accuracy of OL-mean. Interpolated "
            "linearly over the logarithm between tested numbers; intervals by bootstrap over draws of the materials."
        }
        (scroll("Sweeps saved", &plain(&html! { caption.hidden { "Sweeps saved by transfer" } }, &headings, &rows)))
    }
}
