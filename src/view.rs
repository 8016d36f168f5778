//! One HTML page that shows a motion: person, robot and markers in space, and the signals of its joints.
//!
//! The page is a single file that works offline: no network, no foreign font or style, and its own content
//! security policy forbids them. What it needs of three.js (`view/three`) is in it. It is data and a script that
//! draws them: whatever can be computed from the data (where links are, velocities, what soles span) is computed in
//! the page. Summary, warnings and notes need no script.

pub mod foxglove;
pub mod live;
pub mod person;
pub mod robot;
pub mod scene;
pub mod series;
pub mod session;
pub mod tracks;

use crate::error::Error;
use scene::ViewScene;

/// What angles are rounded to, rad: an eighth of a count of a servo with 4096 counts a turn.
pub const ANGLE_RAD: f64 = std::f64::consts::TAU / 32_768.0;
/// What places are rounded to, m.
pub const PLACE_M: f64 = 1e-3;

/// What a page shows.
#[derive(Clone, Debug, Default)]
pub struct ViewPage {
    /// The heading.
    pub title: String,
    /// Name and value of each line of the summary.
    pub summary_rows: Vec<(String, String)>,
    /// What the reader must not overlook.
    pub warnings: Vec<String>,
    /// What the reader may want to know.
    pub notes: Vec<String>,
    /// What is drawn.
    pub scene: ViewScene,
}

/// The script of the page, in the order in which its parts need one another.
const SCRIPT: [&str; 8] = [
    include_str!("view/page/series.js"),
    include_str!("view/page/body.js"),
    include_str!("view/page/live.js"),
    include_str!("view/page/stage.js"),
    include_str!("view/page/signals.js"),
    include_str!("view/page/session.js"),
    include_str!("view/page/poses.js"),
    include_str!("view/page/main.js"),
];

impl ViewPage {
    /// The page as HTML.
    ///
    /// # Errors
    /// A scene that JSON cannot hold.
    pub fn html(&self) -> Result<String, Error> {
        self.written("")
    }

    /// The page as it is served: it may hear of its own server what happens.
    ///
    /// # Errors
    /// As [`ViewPage::html`].
    pub fn live_html(&self) -> Result<String, Error> {
        self.written("; connect-src 'self'")
    }

    /// The page, whose policy allows more by so much.
    fn written(&self, policy: &str) -> Result<String, Error> {
        let scene = serde_json::to_string(&self.scene)
            .map_err(|cause| Error::new("the page cannot be written").got(cause.to_string()))?
            // Inside a script element only `<` could end or open anything.
            .replace('<', "\\u003c");
        let unseen = self.scene.robot.iter().flat_map(|robot| &robot.unseen);
        let notes: Vec<String> = self.notes.iter().chain(unseen).cloned().collect();
        let parts = [
            ("title", escape(&self.title)),
            ("policy", policy.to_owned()),
            ("warnings", list("warnings", "Warnings", &self.warnings)),
            ("summary", self.summary()),
            ("notes", list("notes", "Notes", &notes)),
            ("style", include_str!("view/page/page.css").to_owned()),
            ("scene", scene),
            ("three", include_str!("view/three/three.min.js").to_owned()),
            ("script", SCRIPT.concat()),
        ];
        // Piece by piece: what is put in is not looked through for places.
        let mut html = String::new();
        for (at, piece) in include_str!("view/page/page.html").split("{{").enumerate() {
            let Some((name, rest)) = piece.split_once("}}").filter(|_| at > 0) else {
                html.push_str(piece);
                continue;
            };
            let part = parts.iter().find(|(known, _)| *known == name);
            html.push_str(part.map_or("", |(_, text)| text));
            html.push_str(rest);
        }
        Ok(html)
    }

    fn summary(&self) -> String {
        if self.summary_rows.is_empty() {
            return String::new();
        }
        let row = |(name, value): &(String, String)| {
            format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(name), escape(value))
        };
        let rows: String = self.summary_rows.iter().map(row).collect();
        format!("<dl class=\"summary\" aria-label=\"Summary\">\n{rows}</dl>\n")
    }
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

#[cfg(test)]
mod tests {
    use super::series::Coded;
    use super::tracks::{JointTrack, JointTracks, SampleClock, SpanKind, ViewSpan};
    use super::*;

    const HOSTILE: &str = "</script><img src=x onerror='alert(1)'> & \"knee\" <!-- {{scene}}";

    fn hostile_page() -> String {
        let joint = JointTrack {
            name: HOSTILE.into(),
            goal: Some(Coded::of([0.0, 0.5, f64::NAN], ANGLE_RAD)),
            ..JointTrack::default()
        };
        let scene = ViewScene {
            duration_s: 0.02,
            joints: Some(JointTracks {
                clock: SampleClock::Even { rate_hz: 100.0, count: 3 },
                joints: vec![joint],
            }),
            spans: vec![ViewSpan::new(SpanKind::Event, HOSTILE, HOSTILE, 0.0, 0.01)],
            ..ViewScene::default()
        };
        let page = ViewPage {
            title: HOSTILE.into(),
            summary_rows: vec![(HOSTILE.into(), HOSTILE.into())],
            warnings: vec![HOSTILE.into()],
            notes: vec![HOSTILE.into()],
            scene,
        };
        page.html().unwrap()
    }

    /// The scene as a browser would parse it.
    fn embedded(html: &str) -> serde_json::Value {
        let (_, rest) = html.split_once(r#"<script type="application/json" id="data">"#).unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    #[test]
    fn names_and_texts_cannot_become_markup() {
        let html = hostile_page();
        assert!(!html.contains("<img") && !html.contains("<!-- "));
        assert_eq!(html.matches("</script>").count(), 3, "the scene, three.js and the page's own");
        assert!(html.contains("&lt;/script&gt;&lt;img src=x onerror=&#39;alert(1)&#39;&gt; &amp;"));
        let scene = embedded(&html);
        assert_eq!(scene["joints"]["joints"][0]["name"], HOSTILE, "and yet it is shown as it is");
        assert_eq!(scene["spans"][0]["label"], HOSTILE);
    }

    #[test]
    fn every_element_is_closed_in_order() {
        let html = hostile_page();
        let (mut open, mut rest) = (Vec::new(), html.as_str());
        while let Some((_, tag)) = rest.split_once('<') {
            let (tag, after) = tag.split_once('>').expect("every tag is closed");
            let name = tag.split_whitespace().next().unwrap_or_default().to_lowercase();
            rest = after;
            match name.strip_prefix('/') {
                Some(closed) => assert_eq!(open.pop().as_deref(), Some(closed)),
                None if ["!doctype", "meta", "input"].contains(&name.as_str()) => {}
                None => open.push(name.clone()),
            }
            if name == "script" || name == "style" {
                rest = &rest[rest.find(&format!("</{name}")).expect("it is closed")..];
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn the_page_asks_for_nothing_from_outside() {
        let html = hostile_page();
        // The name of a namespace, which nobody fetches.
        let html = html.replace("http://www.w3.org/1999/xhtml", "");
        let own = html.split_once("<script>").unwrap().0;
        for asks in ["http:", "https:", "url(", "@import", "src=\"", "href="] {
            assert!(!own.contains(asks), "{asks}");
        }
        // While something moves it asks its own server for two things; of a file the policy forbids even that.
        let own = ["fetch(\"stop\"", "new EventSource(\"frames\")"];
        let asking = own.iter().fold(SCRIPT.concat(), |script, own| script.replacen(own, "", 1));
        for asks in ["fetch(", "XMLHttpRequest", "import(", "WebSocket", "EventSource", "http"] {
            assert!(!asking.contains(asks), "{asks}");
        }
        assert!(html.contains("default-src 'none'") && !html.contains("connect-src"));
    }

    #[test]
    fn three_js_comes_with_its_licence_and_the_version_that_is_said() {
        let three = include_str!("view/three/three.min.js");
        let head: String = three.lines().take(30).collect::<Vec<_>>().join("\n");
        let licence = include_str!("view/three/LICENSE");
        assert!(licence.contains("The MIT License") && licence.contains("three.js authors"));
        for line in licence.lines().filter(|line| !line.is_empty()) {
            assert!(head.contains(line), "the bundle's head lacks: {line}");
        }
        let package = include_str!("view/three/package.json");
        let package: serde_json::Value = serde_json::from_str(package).unwrap();
        let version = package["dependencies"]["three"].as_str().unwrap();
        assert!(head.contains(&format!("three.js {version}")), "{version}");
        assert!(three.contains(&format!("\"{}\"", version.split('.').nth(1).unwrap())));
        assert!(!three.contains("eval(") && !three.contains("new Function"));
        assert!(three.len() < 600_000, "{} bytes", three.len());
    }

    #[test]
    fn the_summary_and_the_warnings_need_no_script() {
        let html = ViewPage {
            summary_rows: vec![("Retimed".into(), "1.18 by r_knee".into())],
            warnings: vec!["no reading of r_knee".into()],
            notes: vec!["the clip is eased".into()],
            ..ViewPage::default()
        };
        let html = html.html().unwrap();
        let before_script = html.split_once("<script").unwrap().0;
        for said in [
            "<dt>Retimed</dt><dd>1.18 by r_knee</dd>",
            "<li>no reading of r_knee</li>",
            "<li>the clip is eased</li>",
        ] {
            assert!(before_script.contains(said), "{said}");
        }
    }
}
