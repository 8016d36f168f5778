//! Whoever looks on in a browser: an observer that fills the page, besides another.

use super::cues;
use super::heard::{SensorNow, row};
use super::observer::{
    Event, JointReading, Observer, OtherReading, Progress, RecordingNow, Snapshot,
};
use super::page::live::DRAWN_FOR_M;
use super::report::{Outcome, counted};
use crate::body::{JointAngles, Proportions, SegmentPose};
use crate::port::{Clock, MonotonicClock};
use crate::sensing::{Answer, Cue, Person, SensingEvent};
use crate::time::{Duration, Instant};
use crate::view::live::{LiveEvent, LiveFrame, LiveQuantity, LiveView};
use crate::view::session::PersonNow;
use crate::view::tracks::{SpanKind, ViewSpan};
use glam::DQuat;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Time between pictures.
const PERIOD: Duration = Duration::from_millis(33);
/// Rows of the time line.
const TOLD: &str = "told";
const MISSED: &str = "missed reading";

/// Waits for the next picture.
fn wait() {
    MonotonicClock.sleep_until(MonotonicClock.now() + PERIOD);
}

/// An observer, and whoever looks at the page besides.
pub struct Viewing<'a> {
    observer: &'a dyn Observer,
    view: Option<&'a LiveView>,
    began: Instant,
    told: Mutex<Told>,
}

/// What was told last.
#[derive(Default)]
struct Told {
    frame: LiveFrame,
    /// Joints tell the time; until they do it counts from the beginning.
    is_timed: bool,
    /// By joint, how many readings were missed.
    missed: Vec<u32>,
    /// Whether one of them was when it was looked at last.
    is_missing: Vec<bool>,
    /// What whoever wears the sensors is asked to do.
    asked: String,
}

/// Facts about what whoever wears the sensors is to do now, and after that.
const TO_DO: &str = "to do";
const THEN: &str = "then";

impl Told {
    /// What else of whoever wears sensors is known.
    fn posed(
        &mut self,
        pose: &SegmentPose,
        sensors: &[Option<DQuat>; 13],
        angles: &JointAngles,
        age_s: f64,
    ) {
        // Nobody measured the body: what is drawn is how it is turned.
        if let Ok(body) = Proportions::of_stature(DRAWN_FOR_M) {
            self.frame.persons = vec![PersonNow::of(&body, pose, sensors)];
        }
        // Who is seen was calibrated: there is nothing more to do.
        self.frame.facts.retain(|(name, _)| ![TO_DO, THEN].contains(name));
        self.frame.angles_rad = angles.0.iter().map(|rad| (rad * 1e4).round() / 1e4).collect();
        self.fact("age of the pose", format!("{:.0} ms", age_s * 1e3));
    }

    fn heard(&mut self, sensors: &[SensorNow]) {
        self.frame.sensors = sensors.iter().map(row).collect();
    }

    fn recorded(&mut self, now: &RecordingNow) {
        self.heard(&now.sources);
        let of = now.of_s.map_or_else(String::new, |of_s| format!(" of {of_s:.1}"));
        let lost = match now.dropped {
            0 => String::new(),
            dropped => format!("; the disk was too slow for {}", counted(dropped, "message")),
        };
        self.fact("recorded", format!("{:.1}{of} s{lost}", now.time_s));
    }

    /// What a guide says; what of it happened, rather than is to be done.
    fn led(&mut self, cue: &Cue<'_>) -> Option<SpanKind> {
        let words = cues::of(cue).trim().to_owned();
        match cue {
            Cue::NPose | Cue::TPose | Cue::Move(_) => {
                self.asked = cues::of(&Cue::Next(cue));
                self.frame.facts.retain(|(name, _)| *name != THEN);
                self.fact(TO_DO, self.asked.clone());
            }
            Cue::Next(_) => self.fact(THEN, words),
            Cue::In(_)
            | Cue::HoldStill(_)
            | Cue::Ask(_)
            | Cue::Unknown(_)
            | Cue::Waiting { .. } => {
                let now = [self.asked.as_str(), &words].into_iter().filter(|of| !of.is_empty());
                self.fact(TO_DO, now.collect::<Vec<_>>().join(" \u{2013} "));
            }
            Cue::Good | Cue::OffTPose { .. } | Cue::Note(_) => return Some(SpanKind::Event),
            Cue::Unused(_)
            | Cue::Doubt(_)
            | Cue::Old { .. }
            | Cue::Again(_)
            | Cue::Moved { .. }
            | Cue::Unseen(_) => return Some(SpanKind::Doubt),
        }
        None
    }

    fn fact(&mut self, name: &'static str, words: String) {
        match self.frame.facts.iter_mut().find(|fact| fact.0 == name) {
            Some(fact) => fact.1 = words,
            None => self.frame.facts.push((name, words)),
        }
    }

    /// Joints as they are now; true if their clock began anew.
    fn joints(&mut self, of: LiveFrame) -> bool {
        let is_anew = !self.is_timed || of.time_s < self.frame.time_s;
        self.is_timed = true;
        let LiveFrame { time_s, goal_rad, present_rad, others, .. } = of;
        (self.frame.time_s, self.frame.others) = (time_s, others);
        (self.frame.goal_rad, self.frame.present_rad) = (goal_rad, present_rad);
        is_anew
    }

    /// Joints that began to be silent: each by its number.
    fn missing(&mut self, snapshot: &Snapshot) -> Vec<usize> {
        let missed: Vec<u32> = snapshot.missed().collect();
        self.missed.resize(missed.len(), 0);
        self.is_missing.resize(missed.len(), false);
        let mut begun = Vec::new();
        for (joint, &count) in missed.iter().enumerate() {
            let is_missing = count != self.missed[joint];
            if is_missing && !self.is_missing[joint] {
                begun.push(joint);
            }
            self.is_missing[joint] = is_missing;
        }
        self.missed = missed;
        begun
    }
}

impl<'a> Viewing<'a> {
    /// Both hear what happens, and either may wish for a stop.
    pub fn new(observer: &'a dyn Observer, view: Option<&'a LiveView>) -> Self {
        Self { observer, view, began: MonotonicClock.now(), told: Mutex::default() }
    }

    fn told(&self) -> MutexGuard<'_, Told> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is told, and tells it.
    fn change<T>(&self, view: &LiveView, change: impl FnOnce(&mut Told) -> T) -> T {
        let mut told = self.told();
        if !told.is_timed {
            told.frame.time_s = MonotonicClock.now().seconds_since(self.began);
        }
        let out = change(&mut told);
        view.tell(&told.frame);
        // What was read in turn was read once.
        told.frame.others.clear();
        out
    }

    fn happened(&self, view: &LiveView, kind: SpanKind, row: &str, label: &str) {
        let told = self.told();
        let since = MonotonicClock.now().seconds_since(self.began);
        let time_s = Some(if told.is_timed { told.frame.time_s } else { since });
        let (row, label) = (row.to_owned(), label.to_owned());
        view.happened(LiveEvent { time_s, lasts_s: 0.0, kind, row, label, links: Vec::new() });
    }

    /// What a robot's loop last wrote down.
    fn look(&self, view: &LiveView, snapshot: &Snapshot) {
        // Before the first cycle there is nothing to see, and its clock does not run.
        if snapshot.joints_rad().flatten().all(f64::is_nan) {
            return;
        }
        let joints = LiveFrame {
            others: read(snapshot.take_readings()),
            ..LiveFrame::of(snapshot.time_s(), snapshot.joints_rad())
        };
        let (is_anew, missing) =
            self.change(view, |told| (told.joints(joints), told.missing(snapshot)));
        if is_anew {
            view.begins_anew();
        }
        for joint in missing {
            let names = view.joint_names();
            let name = names.get(joint).map_or("a joint", String::as_str);
            self.happened(view, SpanKind::Wrong, MISSED, name);
        }
    }

    fn show(&self, view: &LiveView, event: Event<'_>) {
        match event {
            Event::Joints { time_s, joints } => {
                let known = |rad: Option<f64>| rad.unwrap_or(f64::NAN);
                let each = joints.iter().map(|of| [known(of.goal_rad), known(of.present_rad)]);
                let others = read(joints.iter().map(reading));
                let frame = LiveFrame { others, ..LiveFrame::of(time_s, each) };
                if self.change(view, |told| told.joints(frame)) {
                    view.begins_anew();
                }
            }
            Event::Posed { pose, sensors, angles, age_s } => {
                self.change(view, |told| told.posed(pose, sensors, angles, age_s));
            }
            Event::Heard(sensors) => self.change(view, |told| told.heard(sensors)),
            Event::Recording(now) => self.change(view, |told| told.recorded(now)),
            Event::Planned { duration_s, approach_s, .. } => {
                let part = |label: &str, start_s: f64, end_s: f64| LiveEvent {
                    time_s: Some(start_s),
                    lasts_s: end_s - start_s,
                    kind: SpanKind::Part,
                    row: "motion".to_owned(),
                    label: label.to_owned(),
                    links: Vec::new(),
                };
                // Its clock begins with the first cycle.
                self.told().joints(LiveFrame::default());
                view.begins_anew();
                if approach_s > 0.0 {
                    view.happened(part("approach", 0.0, approach_s));
                }
                if duration_s.is_finite() {
                    view.happened(part("motion", approach_s, duration_s));
                }
            }
            Event::Foreseen(spans) => {
                for span in spans {
                    let ViewSpan { kind, row, label, start_s, end_s, links } = span.clone();
                    let (time_s, lasts_s) = (Some(start_s), end_s - start_s);
                    view.happened(LiveEvent { time_s, lasts_s, kind, row, label, links });
                }
            }
            Event::Note(text) => self.happened(view, SpanKind::Event, TOLD, text),
            Event::Following => {
                self.happened(view, SpanKind::Event, TOLD, "the robot follows");
            }
            Event::Sensing(event) => {
                let kind = match event {
                    SensingEvent::Back { .. }
                    | SensingEvent::Unstuck { .. }
                    | SensingEvent::Rate { .. }
                    | SensingEvent::OpenToNetwork { .. }
                    | SensingEvent::Server { .. } => SpanKind::Event,
                    _ => SpanKind::Wrong,
                };
                self.happened(view, kind, "sensors", &cues::of_event(event));
            }
            Event::Recognised(event) => {
                if let Some(words) = event.words_of_done() {
                    self.happened(view, SpanKind::Phase, "recognised", &words);
                }
            }
            Event::Angles { .. } | Event::Step { .. } => {}
        }
    }

    /// A person, of whom it is seen as well what they are told.
    #[must_use]
    pub const fn of(&'a self, person: &'a dyn Person) -> Led<'a> {
        Led { person, viewing: self }
    }

    /// Tells whoever still looks how it ended, and why.
    pub fn ended(&self, outcome: Outcome, why: Option<&str>) {
        let Some(view) = self.view else { return };
        let kind = if outcome == Outcome::Done { SpanKind::Event } else { SpanKind::Wrong };
        let why = why.map_or_else(String::new, |why| format!(": {why}"));
        self.happened(view, kind, "end", &format!("{}{why}", outcome.word()));
    }
}

/// Whoever wears sensors, and is guided while somebody looks on.
pub struct Led<'a> {
    person: &'a dyn Person,
    viewing: &'a Viewing<'a>,
}

impl Person for Led<'_> {
    fn tell(&self, cue: Cue<'_>) {
        if let Some(view) = self.viewing.view
            && let Some(kind) = self.viewing.change(view, |told| told.led(&cue))
        {
            self.viewing.happened(view, kind, "calibration", cues::of(&cue).trim());
        }
        self.person.tell(cue);
    }

    fn answer(&self) -> Option<Answer> {
        self.person.answer()
    }

    fn can_answer(&self) -> bool {
        self.person.can_answer()
    }

    fn wants_to_stop(&self) -> bool {
        self.person.wants_to_stop()
    }

    fn wants_a_reset(&self) -> bool {
        self.person.wants_a_reset()
    }

    fn agrees(&self) -> bool {
        self.person.agrees()
    }
}

fn reading(of: &JointReading) -> OtherReading {
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    OtherReading {
        current_a: known(of.current_a),
        load_ratio: known(of.load_ratio),
        temperature_c: known(of.temperature_c),
        voltage_v: known(of.voltage_v),
    }
}

/// What else was read of joints, by the names that a page of a recording has for it.
fn read(joints: impl Iterator<Item = OtherReading>) -> Vec<LiveQuantity> {
    type Of = fn(&OtherReading) -> f64;
    let all: [(&str, &str, Of); 4] = [
        ("current", "A", |of| of.current_a),
        ("load", "of full", |of| of.load_ratio),
        ("temperature", "\u{b0}C", |of| of.temperature_c),
        ("voltage", "V", |of| of.voltage_v),
    ];
    let joints: Vec<OtherReading> = joints.collect();
    let read = all.into_iter().map(|(name, unit, of)| {
        let rounded = |value: f64| value.is_finite().then(|| (value * 1e3).round() / 1e3);
        let values = joints.iter().map(|joint| rounded(of(joint))).collect();
        LiveQuantity { name, unit, values }
    });
    read.filter(|quantity| quantity.values.iter().any(Option::is_some)).collect()
}

/// Tells that something is over, however it ended.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

impl Observer for Viewing<'_> {
    fn hear(&self, event: Event<'_>) {
        if let Some(view) = self.view {
            self.show(view, event);
        }
        self.observer.hear(event);
    }

    fn looks(&self) -> bool {
        self.view.is_some() || self.observer.looks()
    }

    fn wants_to_stop(&self) -> bool {
        self.observer.wants_to_stop() || self.view.is_some_and(LiveView::wants_to_stop)
    }

    fn watch(&self, progress: &Progress<'_>) {
        let Some(view) = self.view else { return self.observer.watch(progress) };
        let (snapshot, is_over) = (progress.snapshot(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_over.load(Ordering::Acquire) {
                    self.look(view, &snapshot);
                    wait();
                }
                self.look(view, &snapshot);
            });
            let _over = Over(&is_over);
            self.observer.watch(progress);
            while !progress.is_over() {
                wait();
            }
        });
    }
}
