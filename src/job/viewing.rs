//! Whoever looks on in a browser: an observer that fills the page, besides another.

use super::observer::{Event, JointReading, Observer, Progress};
use crate::port::{Clock, MonotonicClock};
use crate::time::Duration;
use crate::view::live::{LiveFrame, LiveQuantity, LiveView};
use std::sync::atomic::{AtomicBool, Ordering};

/// Time between pictures.
const PERIOD: Duration = Duration::from_millis(33);

/// Waits for the next picture.
fn wait() {
    MonotonicClock.sleep_until(MonotonicClock.now() + PERIOD);
}

/// An observer, and whoever looks at the page besides.
pub struct Viewing<'a> {
    observer: &'a dyn Observer,
    view: Option<&'a LiveView>,
}

impl<'a> Viewing<'a> {
    /// Both hear what happens, and either may wish for a stop.
    pub fn new(observer: &'a dyn Observer, view: Option<&'a LiveView>) -> Self {
        Self { observer, view }
    }
}

/// What else was read of joints, by the names that a page of a recording has for it.
fn others(joints: &[JointReading]) -> Vec<LiveQuantity> {
    type Of = fn(&JointReading) -> Option<f64>;
    let all: [(&str, &str, Of); 4] = [
        ("current", "A", |of| of.current_a),
        ("load", "of full", |of| of.load_ratio),
        ("temperature", "\u{b0}C", |of| of.temperature_c),
        ("voltage", "V", |of| of.voltage_v),
    ];
    let read = all.into_iter().map(|(name, unit, of)| {
        let rounded = |value: f64| value.is_finite().then(|| (value * 1e3).round() / 1e3);
        let values = joints.iter().map(|joint| of(joint).and_then(rounded)).collect();
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
        if let (Some(view), Event::Joints { time_s, joints }) = (self.view, event) {
            let known = |rad: Option<f64>| rad.unwrap_or(f64::NAN);
            let each = joints.iter().map(|of| [known(of.goal_rad), known(of.present_rad)]);
            view.tell(&LiveFrame { others: others(joints), ..LiveFrame::of(time_s, each) });
        }
        self.observer.hear(event);
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
                    view.tell(&LiveFrame::of(snapshot.time_s(), snapshot.joints_rad()));
                    wait();
                }
                view.tell(&LiveFrame::of(snapshot.time_s(), snapshot.joints_rad()));
            });
            let _over = Over(&is_over);
            self.observer.watch(progress);
            while !progress.is_over() {
                wait();
            }
        });
    }
}
