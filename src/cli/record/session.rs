//! `record --session`, as it is typed: an operator is led through a whole recording session.

mod asked;
mod console;

use super::RecordArgs;
use crate::body::anthropometry::Subject;
use crate::cli::report::Outcome;
use crate::cli::signals::Signals;
use crate::cli::{Deed, Remarks};
use crate::corpus::store::check_outside;
use crate::error::Error;
use crate::job::report::counted;
use crate::job::session::{
    OnPage, Operator, SessionOrder, SessionReport, SessionState, find_demonstrations, open,
};
use crate::session::Plan;
use console::Console;
use std::path::Path;

/// Leads a session, from its beginning or from where it was left; exit code 4 if it was stopped.
///
/// # Errors
/// A folder or sources that cannot be used; a disk that fails.
pub fn run(
    args: &RecordArgs,
    root: &Path,
    signals: Signals,
    remarks: Remarks,
) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    check_outside(root)?;
    let order = SessionOrder {
        folder: root.to_owned(),
        sources: args.sources.clone(),
        wear: args.wear.clone(),
        plan: args.plan.as_deref().map(read_plan).transpose()?,
        magnetometer: args.magnetometer,
        samples: args.encoding,
        known: args.subject.iter().map(|path| read_subject(path)).collect::<Result<_, _>>()?,
    };
    let session = match open(order)? {
        SessionState::Open(session) => session,
        SessionState::Finished(report) => {
            remarks.say("the session is finished already");
            return Ok(conclude(args, &report));
        }
    };
    let view = args.view.open_session(root)?;
    let console = Console::listen(signals.clone(), remarks, args.output.is_json())?;
    let on_page = view.as_ref().map(|view| OnPage::new(&console, view));
    let operator = on_page.as_ref().map_or(&console as &dyn Operator, |on_page| on_page);
    let on = format!("to go on: gaitway record --session {}", root.display());
    let report = session
        .lead(operator)
        .inspect_err(|_| console.say(&format!("\nwhat was done is kept; {on}")))?;
    if report.outcome == Outcome::Stopped {
        // A signal tells more than that somebody stopped.
        let code = signals.first().map_or(report.outcome.exit_code(), |number| 128 + number);
        let text = format!("\nstopped; {on}\n");
        if args.output.is_json() {
            console.say(text.trim_end());
        }
        return Ok(args.output.conclude(&report, &text, Deed::Work, code));
    }
    Ok(conclude(args, &report))
}

fn read_plan(path: &Path) -> Result<Plan, Error> {
    let mut plan = Plan::parse(&gaitway_profiles::read_text(path)?, &path.display().to_string())?;
    find_demonstrations(&mut plan, path.parent().unwrap_or(Path::new("")));
    Ok(plan)
}

/// A subject of another session.
fn read_subject(path: &Path) -> Result<Subject, Error> {
    Subject::parse(&gaitway_profiles::read_text(path)?, &path.display().to_string())
}

fn conclude(args: &RecordArgs, report: &SessionReport) -> i32 {
    let text = format!(
        "finished: {}, {} kept, {}\nwritten   {}\n",
        counted(report.trials, "trial"),
        report.kept,
        counted(report.good_repetitions, "good repetition"),
        report.session.join("manifest.toml").display()
    );
    args.output.conclude(report, &text, Deed::Work, report.outcome.exit_code())
}
