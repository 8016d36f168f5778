//! `--view`: a page that is served while a command runs.

use super::say;
use crate::error::Error;
use crate::job::page::live::{self, Shows};
use crate::rig::{Address, BusKind};
use crate::view::ViewPage;
use crate::view::live::LiveView;
use clap::Args;
use std::path::Path;

pub use crate::job::viewing::Viewing;

/// Whether somebody wants to look.
#[derive(Clone, Debug, Default, Args)]
pub struct ViewArg {
    /// Show what happens in a browser, the robot as it moves and sensors as they are heard: a page that is
    /// served to this machine alone, and whose address is printed; it has a button that stops it as Ctrl-C does
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true,
          default_missing_value = "0")]
    view: Option<u16>,
}

impl ViewArg {
    /// Serves the page of a session and tells its address, if that is wanted.
    ///
    /// # Errors
    /// A port that is taken.
    pub fn open_session(&self, folder: &Path) -> Result<Option<LiveView>, Error> {
        let folder = folder.display().to_string();
        self.view.map(|port| serve(&live::session_page(&folder)?, port)).transpose()
    }

    /// Serves the page of a robot, or of sensors, and tells its address, if that is wanted.
    ///
    /// # Errors
    /// Nothing to show, a robot nobody knows, one in virtual time, a port that is taken.
    pub fn open(
        &self,
        robot: Option<&str>,
        buses: &[Address],
        what: &str,
        shows: Shows,
    ) -> Result<Option<LiveView>, Error> {
        let Some(port) = self.view else { return Ok(None) };
        if let Some(bus) = buses.iter().find(|bus| bus.bus == BusKind::Sim) {
            return Err(Error::new("in virtual time all is over before anybody has looked")
                .at("--view")
                .got(bus.to_string())
                .allowed("sim:pty, or a real line")
                .remedy("--bus sim:pty, where time passes as on a clock; or --html for a page of all of it"));
        }
        if robot.is_none() && shows == Shows::default() {
            return Err(Error::new("a page shows a robot, and none is named")
                .at("--view")
                .remedy("name one: --robot; of `simulate`, the robot"));
        }
        serve(&live::page(robot, what, shows)?, port).map(Some)
    }
}

fn serve(page: &ViewPage, port: u16) -> Result<LiveView, Error> {
    let view = LiveView::open(page, port)?;
    say(&format!("view      {}", view.url()));
    Ok(view)
}
