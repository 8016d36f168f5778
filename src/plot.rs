//! One HTML page that shows a motion: what every joint was asked and what it did.
//!
//! The page is a single file that works offline: no network, no foreign script, font or style
//! (its own content security policy forbids them). Angles are in degrees, because a person reads
//! them. The summary needs no script; the plots are drawn by `plot/page.js`.

mod decimate;

use std::fmt::Write;

use decimate::{Point, decimate};

/// The most points drawn per curve; 20 joints of a minute then stay below 2 MB.
const POINTS: usize = 2_000;

const DECIMATED: &str = "<p class=\"note\">Curves of more than 2000 samples are drawn by the \
    extremes of short stretches: every peak and every gap is there, not every sample.</p>\n";

/// What a page shows.
#[derive(Clone, Debug, Default)]
pub struct PlotPage {
    /// The heading.
    pub title: String,
    /// Name and value of each line of the summary.
    pub summary_rows: Vec<(String, String)>,
    /// What the reader must not overlook.
    pub warnings: Vec<String>,
    /// What the reader may want to know.
    pub notes: Vec<String>,
    /// The joints, in the order of the page.
    pub joints: Vec<JointSeries>,
}

/// One joint's curves over one time axis. A value that is not finite is a gap; a curve shorter
/// than `time_s` ends early; a limit that is not finite is no limit.
#[derive(Clone, Debug, Default)]
pub struct JointSeries {
    /// The joint's name.
    pub name: String,
    /// Time of each sample, seconds, rising.
    pub time_s: Vec<f64>,
    /// Goal position, radians.
    pub goal_rad: Vec<f64>,
    /// Measured position, radians; empty if nothing was measured.
    pub present_rad: Vec<f64>,
    /// Velocity of the goal, rad/s.
    pub goal_velocity_rad_s: Vec<f64>,
    /// Lower position limit, radians.
    pub lower_rad: f64,
    /// Upper position limit, radians.
    pub upper_rad: f64,
    /// Velocity limit, rad/s.
    pub velocity_limit_rad_s: f64,
}

/// The page as HTML.
#[must_use]
pub fn page(page: &PlotPage) -> String {
    let title = escape(&page.title);
    let summary = summary(page);
    let warnings = list("warnings", "Warnings", &page.warnings);
    let notes = list("notes", "Notes", &page.notes);
    let series = series(&page.joints);
    let long = page.joints.iter().any(|joint| joint.time_s.len() > POINTS);
    let note = if long { DECIMATED } else { "" };
    let (style, script) = (include_str!("plot/page.css"), include_str!("plot/page.js"));
    format!(
        r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<h1>{title}</h1>
{warnings}{summary}{notes}</header>
<main>
<div class="bar">
<ul class="legend" aria-label="Legend">
<li class="goal">goal</li>
<li class="present">present</li>
<li class="velocity">goal velocity</li>
<li class="limit">limit</li>
<li class="gap">no reading</li>
</ul>
<output id="time"></output>
<p class="hint">Drag to zoom, double-click to see all, arrow keys to move the cursor</p>
</div>
<noscript><p>The plots need JavaScript; the summary above does not.</p></noscript>
<div id="plots" role="group" tabindex="0"
 aria-label="Joint plots: arrow keys move the cursor, Escape shows the whole motion"></div>
{note}</main>
<script type="application/json" id="series">{series}</script>
<script>
{script}</script>
</body>
</html>
"#
    )
}

fn summary(page: &PlotPage) -> String {
    if page.summary_rows.is_empty() {
        return String::new();
    }
    let rows: String = page
        .summary_rows
        .iter()
        .map(|(name, value)| {
            format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(name), escape(value))
        })
        .collect();
    format!("<dl class=\"summary\" aria-label=\"Summary\">\n{rows}</dl>\n")
}

fn list(class: &str, label: &str, texts: &[String]) -> String {
    if texts.is_empty() {
        return String::new();
    }
    let items: String = texts.iter().map(|text| format!("<li>{}</li>\n", escape(text))).collect();
    format!("<ul class=\"{class}\" aria-label=\"{label}\">\n{items}</ul>\n")
}

/// Text for an element or a quoted attribute.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// The curves as JSON: times in units of 0.1 ms, angles in millidegrees, gaps as null. Whole
/// numbers keep the page small; a thousandth of a degree is finer than any servo's step.
fn series(joints: &[JointSeries]) -> String {
    let mut json = String::from("[");
    for (index, joint) in joints.iter().enumerate() {
        let comma = if index == 0 { "" } else { "," };
        // Inside a script element only `<` could end or open anything.
        let name = serde_json::Value::from(joint.name.as_str()).to_string().replace('<', "\\u003c");
        let _ = write!(json, "{comma}\n{{\"name\":{name}");
        let curves = [
            ("goal", &joint.goal_rad),
            ("present", &joint.present_rad),
            ("velocity", &joint.goal_velocity_rad_s),
        ];
        for (key, values) in curves {
            let points = decimate(&joint.time_s, values, POINTS);
            let _ = write!(json, ",\n\"{key}\":{}", curve(&points));
        }
        let limits = [
            ("lower", joint.lower_rad),
            ("upper", joint.upper_rad),
            ("fastest", joint.velocity_limit_rad_s),
        ];
        for (key, limit) in limits {
            let _ = write!(json, ",\"{key}\":{}", millidegrees(Some(limit)));
        }
        json.push('}');
    }
    json.push(']');
    json
}

fn curve(points: &[Point]) -> String {
    let times: Vec<String> =
        points.iter().map(|point| ((point.time_s * 1e4).round() as i64).to_string()).collect();
    let values: Vec<String> = points.iter().map(|point| millidegrees(point.value)).collect();
    format!("{{\"t\":[{}],\"v\":[{}]}}", times.join(","), values.join(","))
}

fn millidegrees(angle_rad: Option<f64>) -> String {
    let finite = angle_rad.filter(|angle| angle.is_finite());
    finite.map_or("null".into(), |angle| ((angle.to_degrees() * 1e3).round() as i64).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "</script><img src=x onerror='alert(1)'> & \"knee\" <!--";

    fn joint(name: &str, samples: u32) -> JointSeries {
        let time_s: Vec<f64> = (0..samples).map(|n| f64::from(n) * 0.01).collect();
        let goal_rad: Vec<f64> = time_s.iter().map(|t| 1.2 * (7.0 * t).sin()).collect();
        let present_rad = goal_rad.iter().map(|goal| goal * 0.97 - 0.0123).collect();
        let goal_velocity_rad_s = time_s.iter().map(|t| 8.4 * (7.0 * t).cos()).collect();
        JointSeries {
            name: name.into(),
            time_s,
            goal_rad,
            present_rad,
            goal_velocity_rad_s,
            lower_rad: -1.5,
            upper_rad: 1.5,
            velocity_limit_rad_s: f64::INFINITY,
        }
    }

    fn hostile_page() -> String {
        page(&PlotPage {
            title: HOSTILE.into(),
            summary_rows: vec![(HOSTILE.into(), HOSTILE.into())],
            warnings: vec![HOSTILE.into()],
            notes: vec![HOSTILE.into()],
            joints: vec![joint(HOSTILE, 30), joint("r_knee", 2_001)],
        })
    }

    /// The curves as a browser would parse them.
    fn embedded(html: &str) -> serde_json::Value {
        let (_, rest) = html.split_once(r#"<script type="application/json" id="series">"#).unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    /// Tag names in order, `/` before those that close; what scripts and styles hold is skipped,
    /// up to the first thing that a browser would take for their end.
    fn tags(html: &str) -> Vec<String> {
        let mut tags = Vec::new();
        let mut rest = html;
        while let Some((_, tag)) = rest.split_once('<') {
            let (tag, after) = tag.split_once('>').expect("every tag is closed");
            let name = tag.split_whitespace().next().unwrap_or_default().to_lowercase();
            rest = after;
            if name == "script" || name == "style" {
                let end = rest.to_lowercase().find(&format!("</{name}")).expect("it is closed");
                rest = &rest[end..];
            }
            tags.push(name);
        }
        tags
    }

    #[test]
    fn names_and_texts_cannot_become_markup() {
        let html = hostile_page();
        assert!(!html.contains("<img"));
        assert!(!html.contains("<!--"));
        assert_eq!(html.matches("</script>").count(), 2, "one for the curves, one for the code");
        assert!(html.contains("&lt;/script&gt;&lt;img src=x onerror=&#39;alert(1)&#39;&gt; &amp;"));
        assert_eq!(embedded(&html)[0]["name"], HOSTILE, "and yet the name is shown as it is");
    }

    #[test]
    fn every_element_is_closed_in_order() {
        let mut open = Vec::new();
        for tag in tags(&hostile_page()) {
            match tag.strip_prefix('/') {
                Some(closed) => assert_eq!(open.pop().as_deref(), Some(closed)),
                None if ["!doctype", "meta"].contains(&tag.as_str()) => {}
                None => open.push(tag),
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn the_page_asks_for_nothing_from_outside() {
        let html = hostile_page();
        for asks in ["http:", "https:", "//cdn", "url(http", "@import", "src=\"", "href=", "fetch("]
        {
            assert!(!html.contains(asks), "{asks}");
        }
        assert!(html.contains("default-src 'none'"));
    }

    #[test]
    fn the_summary_and_the_warnings_need_no_script() {
        let html = page(&PlotPage {
            summary_rows: vec![("Retimed".into(), "1.18 by r_knee".into())],
            warnings: vec!["no reading of r_knee".into()],
            notes: vec!["the clip is eased".into()],
            ..PlotPage::default()
        });
        let before_script = html.split_once("<script").unwrap().0;
        assert!(before_script.contains("<dt>Retimed</dt><dd>1.18 by r_knee</dd>"));
        assert!(before_script.contains("<li>no reading of r_knee</li>"));
    }

    #[test]
    fn curves_are_in_millidegrees_and_gaps_are_null() {
        let series = JointSeries {
            time_s: vec![0.0, 0.5, 1.0],
            goal_rad: vec![0.0, std::f64::consts::FRAC_PI_2, f64::INFINITY],
            present_rad: vec![f64::NAN, -std::f64::consts::PI],
            lower_rad: f64::NEG_INFINITY,
            upper_rad: std::f64::consts::PI,
            ..JointSeries::default()
        };
        let json = embedded(&page(&PlotPage { joints: vec![series], ..PlotPage::default() }));
        let curve = |t: &[i64], v: serde_json::Value| serde_json::json!({ "t": t, "v": v });
        let goal = curve(&[0, 5_000, 10_000], serde_json::json!([0, 90_000, null]));
        assert_eq!(json[0]["goal"], goal);
        assert_eq!(json[0]["present"], curve(&[0, 5_000], serde_json::json!([null, -180_000])));
        assert_eq!(json[0]["velocity"], curve(&[], serde_json::json!([])));
        assert_eq!(json[0]["lower"], serde_json::Value::Null);
        assert_eq!(json[0]["upper"], 180_000);
    }

    #[test]
    fn twenty_joints_of_a_minute_stay_below_three_megabytes_and_say_that_they_are_thinned() {
        let joints = vec![joint("r_knee", 6_000); 20];
        let html = page(&PlotPage { joints, ..PlotPage::default() });
        assert!(html.len() < 3_000_000, "{} bytes", html.len());
        assert!(html.contains("not every sample"));
        let short = page(&PlotPage { joints: vec![joint("r_knee", 2_000)], ..PlotPage::default() });
        assert!(!short.contains("not every sample"));
    }
}
