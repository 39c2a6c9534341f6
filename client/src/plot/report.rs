//! One HTML file with figures and tables in it; it refers to nothing outside itself.

use std::fmt::Write;

/// A report: a title, a line below it, and sections.
///
/// ```
/// use inekf_client::plot::{Report, Section, Table};
///
/// let report = Report {
///     title: "Laps <1 & 2>".to_owned(),
///     subtitle: "on a wet day".to_owned(),
///     sections: vec![Section {
///         heading: "Error".to_owned(),
///         table: Some(Table {
///             header: vec!["quantity".to_owned(), "RMSE / m".to_owned()],
///             rows: vec![vec!["east".to_owned(), "0.42".to_owned()]],
///         }),
///         ..Section::default()
///     }],
/// };
/// let html = report.to_html();
/// // Text is text, whatever is in it.
/// assert!(html.contains("<h1>Laps &lt;1 &amp; 2&gt;</h1>"));
/// assert!(html.contains("<h2>Error</h2>") && html.contains("0.42"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The title.
    pub title: String,
    /// One line below it: what was run, on which data.
    pub subtitle: String,
    /// The sections, in order.
    pub sections: Vec<Section>,
}

/// A part of a report; every field may be empty.
///
/// ```
/// use inekf_client::plot::{Report, Section, TrajectoryPlot, trajectory};
///
/// let svg = trajectory("From above", &TrajectoryPlot { truth: &[[0.0, 0.0], [5.0, 1.0]], ..Default::default() })?;
/// let section = Section { text: "A short way.".to_owned(), svg: svg.clone(), ..Section::default() };
/// let html = Report { sections: vec![section], ..Report::default() }.to_html();
/// // The figure is in the page itself: one file to send.
/// assert!(html.contains(&svg) && html.contains("<p>A short way.</p>"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// A paragraph.
    pub text: String,
    /// Numbers.
    pub table: Option<Table>,
    /// A figure: SVG text as the functions of this module make it; it is put in as it is.
    pub svg: String,
}

/// A table; the first column is text, the others are numbers and set to the right.
///
/// ```
/// use inekf_client::plot::{Report, Section, Table};
///
/// let table = Table { header: vec!["fix".to_owned(), "count".to_owned()], rows: vec![] };
/// let section = Section { table: Some(table), ..Section::default() };
/// let html = Report { sections: vec![section], ..Report::default() }.to_html();
/// assert!(html.contains("<th>fix</th>") && html.contains("<th>count</th>"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Column names with units.
    pub header: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
}

const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:#24292f;background:#fff;\
max-width:1000px;margin:2rem auto;padding:0 1rem}
h1{margin-bottom:0}
h2{margin-top:2.5rem;border-bottom:1px solid #e4e7eb;padding-bottom:.2rem}
.subtitle{color:#6b727b;margin-top:.2rem}
svg{max-width:100%;height:auto}
table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums}
th,td{padding:.3rem .9rem;border-bottom:1px solid #e4e7eb;text-align:right}
th:first-child,td:first-child{text-align:left}
th{border-bottom:2px solid #a8adb4;font-weight:600}";

impl Report {
    /// The report as HTML.
    ///
    /// ```
    /// use inekf_client::plot::Report;
    ///
    /// let html = Report { title: "A run".to_owned(), ..Report::default() }.to_html();
    /// assert!(html.starts_with("<!DOCTYPE html>") && html.ends_with("</html>\n"));
    /// // Nothing is fetched from elsewhere.
    /// assert!(!html.contains("http"));
    /// ```
    pub fn to_html(&self) -> String {
        let (title, subtitle) = (escape(&self.title), escape(&self.subtitle));
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n\
             <h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n"
        );
        for section in &self.sections {
            section.write(&mut html);
        }
        html.push_str("</body>\n</html>\n");
        html
    }
}

impl Section {
    fn write(&self, html: &mut String) {
        // Writing to a String cannot fail.
        if !self.heading.is_empty() {
            let _ = writeln!(html, "<h2>{}</h2>", escape(&self.heading));
        }
        if !self.text.is_empty() {
            let _ = writeln!(html, "<p>{}</p>", escape(&self.text));
        }
        if let Some(table) = &self.table {
            html.push_str("<table>\n");
            write_row(html, "th", &table.header);
            table.rows.iter().for_each(|row| write_row(html, "td", row));
            html.push_str("</table>\n");
        }
        if !self.svg.is_empty() {
            let _ = writeln!(html, "{}", self.svg.trim());
        }
    }
}

fn write_row(html: &mut String, tag: &str, cells: &[String]) {
    html.push_str("<tr>");
    for cell in cells {
        let _ = write!(html, "<{tag}>{}</{tag}>", escape(cell));
    }
    html.push_str("</tr>\n");
}

/// Text for HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
