//! An operator, and a file in the session's folder that says what is asked for now, so that others can know it: a light beside
//! the subject, a projector, a virtual person ([`Now`]).

use super::happening::Happening;
use super::operator::{
    Answered, Doubt, During, Judged, MeasureAnswer, Mend, Operator, Ready, Repetitions, Unsteady,
    Wish, Words,
};
use super::words::{Asking, told};
use crate::action::vocabulary;
use crate::body::anthropometry::Measure;
use crate::body::worn::Movement;
use crate::error::Error;
use crate::job::cues;
use crate::sensing::{Answer, Cue, Person};
use crate::session::now::{MOVEMENTS, NOW_FILE, NOW_VERSION, Now, NowAction, NowWanted, started};
use crate::session::{Folder, PlannedAction, Verdict};
use crate::time::Duration;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// An operator beside whom it is said what is asked for now. Nothing hangs on whether that works.
pub(super) struct WithNotice<'a> {
    operator: &'a dyn Operator,
    folder: &'a Folder,
    /// Somebody else's file is kept, whatever its name.
    has_a_place: bool,
    stated: Mutex<Stated>,
}

/// What is said, and what that follows from.
#[derive(Default)]
struct Stated {
    now: Now,
    /// How often each was asked of whom.
    times: BTreeMap<String, u64>,
    /// Whom the guide leads.
    subject: Vec<String>,
    /// Who is in the next trial, and of what.
    performers: Vec<String>,
    action: NowAction,
    /// It was said already that it does not work.
    has_failed: bool,
}

impl Stated {
    /// Something is asked for anew.
    fn ask(&mut self, wanted: NowWanted, text: &str) {
        self.ask_for(wanted, None, text);
    }

    /// The same; of a movement, which.
    fn ask_for(&mut self, wanted: NowWanted, movement: Option<Movement>, text: &str) {
        let now = &mut self.now;
        let named = MOVEMENTS.iter().find(|(_, known)| Some(*known) == movement);
        now.movement = named.map(|(name, _)| (*name).to_owned());
        (now.wanted, now.hold_s, now.recording) = (wanted, None, false);
        text.trim().clone_into(&mut now.text);
        now.subjects = match wanted {
            NowWanted::Wait | NowWanted::LieStill => Vec::new(),
            NowWanted::PutOn | NowWanted::NPose | NowWanted::TPose | NowWanted::Move => {
                self.subject.clone()
            }
            NowWanted::Watch | NowWanted::Practise | NowWanted::Perform => self.performers.clone(),
        };
        let is_of_action =
            matches!(wanted, NowWanted::Watch | NowWanted::Practise | NowWanted::Perform);
        now.action = is_of_action.then(|| self.action.clone());
        now.request += 1;
        let same = format!("{} {}", now.word(), now.subjects.join(" "));
        let times = self.times.entry(same).or_default();
        *times += 1;
        now.times = *times;
    }

    /// Nothing is asked of anybody any more; who waits already goes on waiting.
    fn wait(&mut self, text: &str) {
        match self.now.wanted {
            NowWanted::Wait if self.now.request > 0 => text.trim().clone_into(&mut self.now.text),
            _ => self.ask(NowWanted::Wait, text),
        }
    }

    fn hear(&mut self, happening: &Happening<'_>) {
        let text = told(happening);
        match *happening {
            Happening::MeasuringStill { seconds } => {
                self.now.hold_s = Some(seconds);
                self.now.text = text;
            }
            Happening::FacingForward { subject } => self.subject = vec![subject.to_owned()],
            Happening::NextTrial { action, subjects, good, wanted, .. } => {
                self.performers = subjects.to_vec();
                self.action = of(action, good, wanted);
            }
            Happening::Recording { trial } => {
                self.action.trial = Some(trial.to_owned());
                self.ask(NowWanted::Perform, &text);
                self.now.recording = true;
            }
            Happening::Marked { good, bad, .. } => {
                if let Some(action) = &mut self.now.action {
                    (action.good, action.bad) = (self.action.good.saturating_add(good), bad);
                }
            }
            Happening::Ahead { .. }
            | Happening::CutShort(_)
            | Happening::Recorded(_)
            | Happening::Finishing => self.wait(&text),
            _ => {}
        }
    }

    fn cue(&mut self, cue: &Cue<'_>) {
        let text = cues::of(cue);
        match *cue {
            Cue::NPose => self.ask(NowWanted::NPose, &text),
            Cue::TPose => self.ask(NowWanted::TPose, &text),
            Cue::Move(movement) => self.ask_for(NowWanted::Move, Some(movement), &text),
            Cue::HoldStill(time) => {
                self.now.hold_s = Some(time.as_secs_f64());
                text.trim().clone_into(&mut self.now.text);
            }
            Cue::Good | Cue::OffTPose { .. } | Cue::Unseen(_) => self.wait(&text),
            _ => {}
        }
    }
}

/// What is said of an action.
fn of(action: &PlannedAction, good: u32, wanted: u32) -> NowAction {
    let shipped = vocabulary::find(&action.name).and_then(|shipped| shipped.perform());
    NowAction {
        name: action.name.clone(),
        explain: action.explain.clone(),
        lasts_s: shipped.ok().map(|motion| motion.duration_s()),
        good,
        wanted,
        ..NowAction::default()
    }
}

impl<'a> WithNotice<'a> {
    pub(super) fn new(operator: &'a dyn Operator, folder: &'a Folder) -> Self {
        let pid = std::process::id();
        let started = started(pid).unwrap_or(0);
        let now = Now { gaitway_now: NOW_VERSION, pid, started, ..Now::default() };
        let stated = Mutex::new(Stated { now, ..Stated::default() });
        let has_a_place = Now::has_a_place(folder.root());
        let with = Self { operator, folder, has_a_place, stated };
        with.change(|stated| stated.wait(""));
        with
    }

    fn stated(&self) -> MutexGuard<'_, Stated> {
        self.stated.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is said. Where it cannot be said that is told once, and the session goes on.
    fn change(&self, change: impl FnOnce(&mut Stated)) {
        let failed = {
            let mut stated = self.stated();
            let before = stated.now.clone();
            change(&mut stated);
            if stated.now == before {
                return;
            }
            stated.now.change += 1;
            let text = serde_json::to_string_pretty(&stated.now).unwrap_or_default();
            let failed = match self.has_a_place {
                true => self.folder.put_up(NOW_FILE, format!("{text}\n").as_bytes()).err(),
                false => Some(
                    Error::new("there is a file of this name that no session wrote; it is kept")
                        .at(self.folder.path(NOW_FILE).display().to_string())
                        .remedy("give it another name, if others are to know what is asked"),
                ),
            };
            failed.filter(|_| !std::mem::replace(&mut stated.has_failed, true))
        };
        if let Some(error) = failed {
            self.operator.hear(Happening::NotAnnounced(&error));
        }
    }

    /// Asks the operator something while subjects wait.
    fn asked<T>(&self, asking: &Asking, answer: impl FnOnce() -> Answered<T>) -> Answered<T> {
        self.change(|stated| stated.wait(&words(asking)));
        answer()
    }
}

/// What is said and asked, without what may be answered.
fn words(asking: &Asking) -> String {
    format!("{}\n{}", asking.before.trim(), asking.question).trim().to_owned()
}

impl Drop for WithNotice<'_> {
    fn drop(&mut self) {
        if self.has_a_place {
            self.folder.take_down(NOW_FILE);
        }
    }
}

impl Person for WithNotice<'_> {
    fn tell(&self, cue: Cue<'_>) {
        self.change(|stated| stated.cue(&cue));
        self.operator.person().tell(cue);
    }

    fn answer(&self) -> Option<Answer> {
        self.operator.person().answer()
    }

    fn can_answer(&self) -> bool {
        self.operator.person().can_answer()
    }

    fn wants_to_stop(&self) -> bool {
        self.operator.person().wants_to_stop()
    }

    fn wants_a_reset(&self) -> bool {
        self.operator.person().wants_a_reset()
    }

    fn agrees(&self) -> bool {
        self.operator.person().agrees()
    }
}

impl Operator for WithNotice<'_> {
    fn person(&self) -> &dyn Person {
        self
    }

    fn hear(&self, happening: Happening<'_>) {
        // What comes many times a second asks for nothing.
        if !matches!(
            happening,
            Happening::Heard(_) | Happening::Posed { .. } | Happening::Sensing(_)
        ) {
            self.change(|stated| stated.hear(&happening));
        }
        self.operator.hear(happening);
    }

    fn looks(&self) -> bool {
        self.operator.looks()
    }

    fn ready(&self, what: Ready<'_>) -> Answered<()> {
        let text = words(&Asking::ready(&what));
        self.change(|stated| match what {
            Ready::LyingStill { .. } => stated.ask(NowWanted::LieStill, &text),
            Ready::Worn { subject, .. } => {
                stated.subject = vec![subject.to_owned()];
                stated.ask(NowWanted::PutOn, &text);
            }
            Ready::Explained => stated.ask(NowWanted::Watch, &text),
            Ready::Practised => stated.ask(NowWanted::Practise, &text),
            Ready::Again { .. } | Ready::Retake { .. } => stated.wait(&text),
        });
        self.operator.ready(what)
    }

    fn words(&self, what: Words<'_>) -> Answered<String> {
        self.asked(&Asking::words(&what), || self.operator.words(what))
    }

    fn actions(&self) -> Answered<Vec<String>> {
        self.asked(&Asking::actions(), || self.operator.actions())
    }

    fn needed_measure(&self, measure: Measure) -> Answered<f64> {
        self.asked(&Asking::measure(measure), || self.operator.needed_measure(measure))
    }

    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer> {
        self.asked(&Asking::measure(measure), || self.operator.measure(measure))
    }

    fn is_right(&self, doubt: Doubt<'_>) -> Answered<bool> {
        self.asked(&Asking::is_right(&doubt), || self.operator.is_right(doubt))
    }

    fn unsteady(&self) -> Answered<Unsteady> {
        self.asked(&Asking::unsteady(), || self.operator.unsteady())
    }

    fn mend(&self, error: &Error) -> Answered<Mend> {
        self.asked(&Asking::mend(error), || self.operator.mend(error))
    }

    fn judge(&self, what: Judged<'_>, usual: Verdict) -> Answered<Verdict> {
        self.asked(&Asking::judge(&what, usual), || self.operator.judge(what, usual))
    }

    fn wish(&self, trial: &str) -> Answered<Wish> {
        self.asked(&Asking::wish(trial), || self.operator.wish(trial))
    }

    fn during_trial(&self, within: Duration) -> Answered<During> {
        let said = self.operator.during_trial(within);
        if matches!(said, Ok(During::End) | Err(_)) {
            self.change(|stated| stated.wait("the trial is over"));
        }
        said
    }

    fn repetitions(&self, marked: usize) -> Answered<Repetitions> {
        self.asked(&Asking::repetitions(marked), || self.operator.repetitions(marked))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::session::obliging::Yes;
    use crate::session::now::Now;
    use std::path::PathBuf;

    fn folder(name: &str) -> PathBuf {
        let root =
            std::env::temp_dir().join(format!("gaitway-notice-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        root
    }

    #[test]
    fn a_file_of_that_name_that_no_session_wrote_is_kept_and_that_is_said_once() {
        let root = folder("kept");
        let folder = Folder::open(&root).expect("a folder");
        for foreign in ["[1, 2]", "my own notes", "{\"wanted\": \"t_pose\"}"] {
            std::fs::write(root.join(NOW_FILE), foreign).expect("written");
            let yes = Yes::default();
            let with = WithNotice::new(&yes, &folder);
            with.person().tell(Cue::NPose);
            with.person().tell(Cue::TPose);
            drop(with);
            let kept = std::fs::read_to_string(root.join(NOW_FILE)).expect("it is there");
            assert_eq!(kept, foreign);
            let said = yes.0.lock().expect("whole").join("\n");
            assert_eq!(said.matches("no session wrote").count(), 1, "{said}");
        }
        // One that a session left behind, of another version too, makes way.
        std::fs::write(root.join(NOW_FILE), "{\"gaitway_now\": 7}").expect("written");
        let yes = Yes::default();
        drop(WithNotice::new(&yes, &folder));
        assert!(!root.join(NOW_FILE).exists());
        assert_eq!(yes.0.lock().expect("whole").len(), 0);
        std::fs::remove_dir_all(root).expect("taken away");
    }

    #[test]
    fn what_is_asked_now_stands_in_the_folder_and_is_gone_at_the_end() {
        let root = folder("asked");
        let folder = Folder::open(&root).expect("a folder");
        let yes = Yes::default();
        let with = WithNotice::new(&yes, &folder);
        let now = || Now::read(&root).expect("readable").expect("it is there");
        let asked = || (now().wanted, now().times, now().subjects);
        let nobody = Vec::new;
        let s01 = || vec!["s01".to_owned()];
        assert_eq!(asked(), (NowWanted::Wait, 1, nobody()));
        let _ = with.ready(Ready::LyingStill { sensors: &["torso".to_owned()] });
        assert_eq!(asked(), (NowWanted::LieStill, 1, nobody()));
        with.hear(Happening::MeasuringStill { seconds: 2.5 });
        assert_eq!((asked(), now().hold_s), ((NowWanted::LieStill, 1, nobody()), Some(2.5)));
        let _ = with.ready(Ready::Worn { subject: "s01", segments: &[] });
        assert_eq!(asked(), (NowWanted::PutOn, 1, s01()));
        let person = with.person();
        person.tell(Cue::NPose);
        assert_eq!(asked(), (NowWanted::NPose, 1, s01()));
        let request = now().request;
        person.tell(Cue::HoldStill(Duration::from_secs(3)));
        assert_eq!((now().request, now().hold_s), (request, Some(3.0)), "the same request");
        // Somebody moved: the same is asked anew.
        person.tell(Cue::NPose);
        assert_eq!(asked(), (NowWanted::NPose, 2, s01()));
        assert_eq!((now().request, now().hold_s), (request + 1, None));
        person.tell(Cue::Good);
        assert_eq!(asked(), (NowWanted::Wait, 2, nobody()));
        person.tell(Cue::TPose);
        assert_eq!(asked(), (NowWanted::TPose, 1, s01()));
        for (times, movement) in [(1, Movement::Bow), (1, Movement::Bend), (2, Movement::Bow)] {
            person.tell(Cue::Move(movement));
            assert_eq!(asked(), (NowWanted::Move, times, s01()), "{movement:?}");
        }
        assert_eq!(now().movement.as_deref(), Some("bow"));
        let action = PlannedAction { name: "bow".into(), ..PlannedAction::default() };
        let both = ["s01".to_owned(), "s02".to_owned()];
        let next = Happening::NextTrial {
            number: 1,
            total: 1,
            action: &action,
            subjects: &both,
            good: 3,
            wanted: 5,
        };
        with.hear(next);
        let _ = with.ready(Ready::Practised);
        assert_eq!(asked(), (NowWanted::Practise, 1, both.to_vec()));
        with.hear(Happening::FacingForward { subject: "s02" });
        person.tell(Cue::NPose);
        assert_eq!(asked(), (NowWanted::NPose, 1, vec!["s02".to_owned()]));
        with.hear(Happening::Recording { trial: "bow-01" });
        with.hear(Happening::Marked { note: None, good: 1, bad: 2, time_s: 1.0 });
        let action = now().action.expect("an action");
        assert!(now().recording);
        assert_eq!((action.name.as_str(), action.trial.as_deref()), ("bow", Some("bow-01")));
        assert_eq!((action.good, action.wanted, action.bad), (4, 5, 2));
        // As its file says.
        assert_eq!(action.lasts_s, Some(2.8));
        let _ = with.during_trial(Duration::from_millis(1));
        assert_eq!((asked().0, now().recording, now().action), (NowWanted::Wait, false, None));
        drop(with);
        assert_eq!(Now::read(&root), Ok(None));
        assert!(!root.join("now.json.new").exists());
        std::fs::remove_dir_all(root).expect("taken away");
    }

    #[test]
    fn where_it_cannot_be_written_that_is_told_once_and_the_session_goes_on() {
        let root = folder("taken");
        // Nothing of that keeps a session from beginning: it may have been left behind.
        std::fs::create_dir_all(root.join(NOW_FILE).join("inside")).expect("in its place");
        let folder = Folder::open(&root).expect("a folder");
        let yes = Yes::default();
        {
            let with = WithNotice::new(&yes, &folder);
            assert_eq!(with.ready(Ready::Explained), Ok(()));
            with.person().tell(Cue::NPose);
        }
        let said = yes.0.lock().expect("whole").clone();
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].contains("the session goes on") && said[0].contains(NOW_FILE), "{said:?}");
        std::fs::remove_dir_all(root).expect("taken away");
    }

    /// A link that somebody laid there leads nowhere else.
    #[test]
    fn nothing_is_written_through_a_link() {
        let root = folder("link");
        let folder = Folder::open(&root).expect("a folder");
        let victim = root.join("angles/victim");
        std::fs::write(&victim, "mine").expect("written");
        for name in [NOW_FILE, "now.json.new"] {
            std::os::unix::fs::symlink(&victim, root.join(name)).expect("a link");
        }
        let yes = Yes::default();
        let with = WithNotice::new(&yes, &folder);
        assert_eq!(std::fs::read_to_string(&victim).expect("it"), "mine");
        assert!(Now::read(&root).expect("readable").is_some());
        drop(with);
        assert_eq!(std::fs::read_to_string(&victim).expect("it"), "mine");
        assert!(yes.0.lock().expect("whole").is_empty());
        std::fs::remove_dir_all(root).expect("taken away");
    }
}
