//! Skeleton of all HTML pages.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::{STYLE, theme};

/// Style sheet of pages without a separate one.
const PAGE_STYLE: &str = include_str!("page.css");

/// Self-contained HTML page: it loads no other files, and its colours adapt to light and dark mode.
///
/// ```
/// use maud::html;
/// use tactnet_plot::Page;
///
/// let page = Page::new("Round trips", html! { p { "4 B < 1 MB" } }).to_html();
/// assert!(page.contains("<h1>Round trips</h1>") && page.contains("4 B &lt; 1 MB"));
/// ```
#[derive(Debug, Clone)]
pub struct Page<'a> {
    /// Title of the browser's tab.
    pub title: &'a str,
    /// CSS that follows the colours and the style of figures.
    pub style: &'a str,
    /// Elements that the head contains in addition, such as a `noscript` style.
    pub head: Markup,
    /// Content of the body.
    pub body: Markup,
    /// JavaScript at the end of the body; empty for none.
    pub script: &'a str,
}

impl<'a> Page<'a> {
    /// Returns a page with the common style sheet, whose body is the title as heading and `content`.
    pub fn new(title: &'a str, content: Markup) -> Self {
        Self {
            title,
            style: PAGE_STYLE,
            head: html! {},
            body: html! { h1 { (title) } (content) },
            script: "",
        }
    }

    /// Returns the page as HTML.
    pub fn to_html(&self) -> String {
        let policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    meta http-equiv="Content-Security-Policy" content=(policy);
                    link rel="icon" href="data:,";
                    title { (self.title) }
                    style { (PreEscaped(theme())) (PreEscaped(STYLE)) (PreEscaped(self.style)) }
                    (self.head)
                }
                body {
                    (self.body)
                    @if !self.script.is_empty() {
                        script { (PreEscaped(self.script)) }
                    }
                }
            }
        }
        .into_string()
    }
}
