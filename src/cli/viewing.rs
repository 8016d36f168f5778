//! `--view`: a page that is served while a command runs, and the observer that fills it.

use super::say;
use crate::error::Error;
use crate::job::page::live;
use crate::job::{Event, Observer, Progress};
use crate::rig::{Address, BusKind};
use crate::view::live::{LiveFrame, LiveView};
use clap::Args;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Pictures per second, at most.
const PERIOD: Duration = Duration::from_millis(33);

/// Whether somebody wants to look.
#[derive(Clone, Debug, Default, Args)]
pub struct ViewArg {
    /// Show the robot in a browser as it moves: a page that is served to this machine alone, and whose
    /// address is printed; it has a button that stops the robot as Ctrl-C does
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true,
          default_missing_value = "0")]
    view: Option<u16>,
}

impl ViewArg {
    /// Serves the page of a robot and tells its address, if that is wanted.
    ///
    /// # Errors
    /// A robot nobody knows, one in virtual time, a port that is taken.
    pub fn open(
        &self,
        robot: Option<&str>,
        buses: &[Address],
        what: &str,
    ) -> Result<Option<LiveView>, Error> {
        let Some(port) = self.view else { return Ok(None) };
        if let Some(bus) = buses.iter().find(|bus| bus.bus == BusKind::Sim) {
            return Err(Error::new("in virtual time all is over before anybody has looked")
                .at("--view")
                .got(bus.to_string())
                .allowed("sim:pty, or a real line")
                .remedy("--bus sim:pty, where time passes as on a clock; or --html for a page of all of it"));
        }
        let robot = robot.ok_or_else(|| {
            Error::new("a page shows a robot").at("--view").remedy("add --robot and --bus")
        })?;
        let view = LiveView::open(&live::page(robot, what)?, port)?;
        say(&format!("view      {}", view.url()));
        Ok(Some(view))
    }
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
            view.tell(&LiveFrame::of(time_s, each));
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
                    std::thread::sleep(PERIOD);
                }
                view.tell(&LiveFrame::of(snapshot.time_s(), snapshot.joints_rad()));
            });
            let _over = Over(&is_over);
            self.observer.watch(progress);
            while !progress.is_over() {
                std::thread::sleep(PERIOD);
            }
        });
    }
}
