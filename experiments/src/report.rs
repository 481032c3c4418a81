//! A summary as a self-contained HTML page that loads nothing and works on phones, in dark mode and without a mouse.

mod audit;
mod benchmark;
mod beside_published;
mod by_length;
mod calibration;
mod class_bars;
mod confusion;
mod contender;
mod data_set;
#[cfg(test)]
pub(crate) mod fake;
mod header;
mod headline;
mod intervals;
mod material_groups;
mod paired;
mod pareto;
mod provenance;
mod ranks;
mod results;
mod study;
mod table;
mod terms;
mod text;

use maud::{Markup, PreEscaped, html};
use tactnet_plot::Page;

use crate::{Question, Summary};
use data_set::data_sets;

const STYLE: &str = include_str!("report/report.css");
const SCRIPT: &str = include_str!("report/report.js");

/// Style of headings that cannot sort without JavaScript.
const WITHOUT_SCRIPT: &str =
    "th button { pointer-events: none; } th button::after { content: none; }";

/// Heading of the section on provenance.
const PROVENANCE: &str = "Where the numbers come from";

/// A section of the page; one without body is left out.
struct Section {
    id: &'static str,
    heading: &'static str,
    body: Option<Markup>,
}

impl Section {
    fn new(id: &'static str, heading: &'static str, body: Option<Markup>) -> Self {
        Self { id, heading, body }
    }
}

/// Returns a summary as one HTML page. It loads nothing and works, as plain tables, without JavaScript.
pub fn to_html(summary: &Summary) -> String {
    if !matches!(summary.question, Question::Crossval(_)) {
        let headline = headline::of_study(summary);
        return page(summary, &headline, &study::sections(summary));
    }
    let contenders = summary.scored();
    let sets = data_sets(&contenders);
    let terms = terms::terms(summary.question.ask().terms());
    let provenance = provenance::section(summary, &contenders, &sets);
    let published = beside_published::section(&sets);
    let benchmark = summary.benchmark.as_ref();
    let sections = [
        Section::new(
            "sets",
            "Data sets and models",
            benchmark.map(|found| benchmark::section(found, &summary.left_out)),
        ),
        Section::new(
            "ranks",
            "Mean ranks over data sets",
            match benchmark {
                Some(benchmark) => ranks::of_benchmark(benchmark),
                None => ranks::section(&contenders),
            },
        ),
        Section::new(
            "pareto",
            "Error and training time",
            benchmark.and_then(pareto::section),
        ),
        Section::new("results", "Results", results::section(&contenders, &sets)),
        Section::new(
            "accuracy",
            "Accuracy at a glance",
            intervals::section(&sets),
        ),
        Section::new(
            "comparisons",
            "Paired comparisons",
            paired::section(summary, &sets),
        ),
        Section::new("audit", "What the data give away", audit::section(summary)),
        Section::new(
            "contenders",
            "Best contenders",
            contender::section(summary, &sets),
        ),
        Section::new("lengths", "Length of the sweeps", by_length::section(&sets)),
        Section::new("published", "Beside the published confusions", published),
        Section::new(
            "groups",
            "Groups of materials",
            material_groups::section(summary, &sets),
        ),
        Section::new("provenance", PROVENANCE, Some(provenance)),
        Section::new("glossary", "How to read this", Some(terms)),
    ];
    let headline = match benchmark.and_then(benchmark::headline) {
        Some(placed) => headline::of_benchmark(summary, placed),
        None => headline::of_contenders(summary, &sets),
    };
    page(summary, &headline, &sections)
}

/// Returns the page around its sections.
fn page(summary: &Summary, headline: &Markup, sections: &[Section]) -> String {
    let sections = || sections.iter().filter(|section| section.body.is_some());
    let body = html! {
        a.skip href="#main" { "Skip to the results" }
        header { (header::header(summary, headline)) }
        nav aria-label="Contents" {
            ul.contents {
                @for section in sections() { li { a href={ "#" (section.id) } { (section.heading) } } }
            }
        }
        main #main tabindex="-1" {
            @for section in sections() {
                section aria-labelledby=(section.id) {
                    h2 id=(section.id) { (section.heading) }
                    @if let Some(body) = &section.body { (body) }
                }
            }
        }
    };
    let page = Page {
        title: &summary.title,
        style: STYLE,
        head: html! { noscript { style { (PreEscaped(WITHOUT_SCRIPT)) } } },
        body,
        script: SCRIPT,
    };
    page.to_html()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Identifiers of the sections, in their order.
    fn sections_of(page: &str) -> Vec<&str> {
        let headings = page.split("<h2 id=\"").skip(1);
        headings
            .map(|rest| rest.split('"').next().unwrap())
            .collect()
    }

    #[test]
    fn sections_are_in_order_and_those_without_content_are_left_out() {
        let all = [
            "ranks",
            "results",
            "accuracy",
            "comparisons",
            "audit",
            "contenders",
            "lengths",
            "published",
            "groups",
            "provenance",
            "glossary",
        ];
        let without = |left_out: &[&str]| -> Vec<&str> {
            let kept = all.iter().filter(|id| !left_out.contains(id));
            kept.copied().collect()
        };
        assert_eq!(
            sections_of(&to_html(&fake::summary())),
            without(&["published", "ranks"])
        );
        assert_eq!(
            sections_of(&to_html(&fake::tactmat())),
            without(&["comparisons", "audit", "lengths", "groups", "ranks"])
        );
        assert_eq!(
            sections_of(&to_html(&fake::empty())),
            ["provenance", "glossary"]
        );
    }

    #[test]
    fn a_benchmark_begins_with_its_table() {
        let mut summary = fake::summary();
        summary.benchmark = Some(crate::benchmark::tests::of_accuracies(&[
            ("felt", &[Some(0.9), Some(0.8), Some(0.7)]),
            ("cork", &[Some(0.9), Some(0.8), Some(0.7)]),
            ("wood", &[Some(0.9), Some(0.8), Some(0.7)]),
        ]));
        let page = to_html(&summary);
        assert_eq!(
            sections_of(&page)[..4],
            ["sets", "ranks", "pareto", "results"]
        );
        assert!(page.contains("mean error of <code>lda</code> over 3 data sets"));
    }

    #[test]
    fn the_headline_is_the_first_text_after_the_title() {
        for summary in [
            fake::summary(),
            fake::tactmat(),
            fake::empty(),
            fake::study(),
        ] {
            let page = to_html(&summary);
            let (_, after) = page.split_once("</h1>").unwrap();
            assert!(after.trim_start().starts_with("<div class=\"headline"));
            assert!(after.contains("<p class=\"lead\">"));
            // What repeats the run comes last and is folded.
            let (before, provenance) = page.split_once("id=\"provenance\"").unwrap();
            assert!(provenance.contains("<dt>Seed</dt>") && !before.contains("<dt>"));
            assert!(!provenance.contains("<details open"));
        }
    }

    #[test]
    fn published_figures_stand_only_where_they_may_be_compared() {
        let recorded = to_html(&fake::summary());
        assert!(!recorded.contains("Published for TactMat"));
        let mut alone = fake::tactmat();
        for contender in &mut alone.contenders {
            contender.published = None;
        }
        assert!(!to_html(&alone).contains("hollow diamond"));
        assert!(to_html(&fake::tactmat()).contains("hollow diamond"));
    }

    #[test]
    fn the_page_loads_nothing() {
        let page = to_html(&fake::summary());
        for reference in ["http://", "https://", " src=", "@import", "url("] {
            assert!(!page.contains(reference), "{reference}");
        }
        let links: Vec<&str> = page
            .split("href=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
            .collect();
        assert!(
            links.iter().any(|link| link.starts_with("./")),
            "predictions are linked"
        );
        for link in links {
            let local = ["#", "./", "data:,"]
                .iter()
                .any(|start| link.starts_with(start));
            assert!(local, "{link}");
        }
    }

    #[test]
    fn text_is_escaped() {
        let page = to_html(&fake::summary());
        assert!(!page.contains(fake::HOSTILE));
        assert!(page.contains("&lt;b&gt;&amp;&quot;"));
        assert!(!page.contains("<b>"));
        assert_eq!(page.matches("<script>").count(), 1);
        assert_eq!(page.matches("</script>").count(), 1);
    }

    #[test]
    fn elements_are_closed() {
        for summary in [
            fake::summary(),
            fake::tactmat(),
            fake::empty(),
            fake::study(),
        ] {
            let page = to_html(&summary);
            for name in [
                "figure",
                "figcaption",
                "svg",
                "g",
                "table",
                "thead",
                "tbody",
                "tr",
                "th",
                "td",
                "details",
                "section",
                "div",
                "p",
                "ul",
                "li",
                "dl",
                "span",
                "button",
                "title",
                "text",
            ] {
                let open = page.matches(&format!("<{name}>")).count()
                    + page.matches(&format!("<{name} ")).count();
                let closed = page.matches(&format!("</{name}>")).count();
                assert_eq!(open, closed, "<{name}>");
            }
            assert_eq!(
                page.matches("<figure").count(),
                page.matches("<figcaption").count()
            );
            assert_eq!(
                page.matches("role=\"img\"").count(),
                page.matches("<svg class=\"figure").count()
                    - page.matches("<svg class=\"figure\" aria-hidden").count()
            );
        }
    }

    #[test]
    fn identifiers_are_unique() {
        let page = to_html(&fake::tactmat());
        let mut seen = std::collections::BTreeSet::new();
        for rest in page.split(" id=\"").skip(1) {
            let id = rest.split('"').next().unwrap();
            assert!(seen.insert(id), "{id} twice");
        }
    }

    #[test]
    fn a_study_has_its_own_sections() {
        let page = to_html(&fake::study());
        for id in [
            "results",
            "curves",
            "comparisons",
            "efficiency",
            "provenance",
            "glossary",
        ] {
            assert!(page.contains(&format!("<h2 id=\"{id}\">")), "{id}");
        }
        assert!(!page.contains(fake::HOSTILE));
        for reference in ["http://", "https://", " src=", "@import", "url("] {
            assert!(!page.contains(reference), "{reference}");
        }
    }

    #[test]
    fn unfinished_experiments_say_so() {
        let mut summary = fake::summary();
        assert!(!to_html(&summary).contains("class=\"warning\""));
        summary.tasks_done -= 1;
        assert!(to_html(&summary).contains("class=\"warning\""));
    }

    #[test]
    fn numbers_on_the_twin_are_marked() {
        let mut summary = fake::summary();
        assert!(!to_html(&summary).contains("synthetic"));
        let record = |origin| crate::DataRecord {
            sha256: "00".into(),
            origin,
            assumed_rate_hz: None,
        };
        // A name alone says nothing.
        let recorded = record(tactnet_data::DataOrigin::Recorded);
        summary.data.insert("twin".into(), recorded);
        assert!(!to_html(&summary).contains("are synthetic"));
        let twin = record(tactnet_data::DataOrigin::Twin2);
        summary.data.insert("my-copy".into(), twin);
        assert!(to_html(&summary).contains("are synthetic"));
    }

    #[test]
    fn the_published_confusions_appear_beside_the_same_materials_only() {
        assert!(to_html(&fake::tactmat()).contains("Published: humans"));
        assert!(!to_html(&fake::summary()).contains("Published: humans"));
    }
}
