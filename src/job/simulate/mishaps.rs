//! Scripts of what goes wrong with a virtual person who takes part in a session.

use super::acting::{Act, Stays};
use crate::body::worn::Movement;
use crate::body::{Segment, segment_named};
use crate::error::{Error, ErrorKind};
use crate::session::now::{MOVEMENTS, Now};
use crate::toml_text::{from_toml, plain_words};
use serde::Deserialize;
use std::path::Path;

/// Longest time in a script, s.
const LONGEST_S: f64 = 86_400.0;
/// Most mishaps of a script.
const MOST: usize = 1000;
/// What may be asked, by the words of `now.json`; movements have their own names.
const REQUESTS: [&str; 11] = [
    "lie_still",
    "put_on",
    "n_pose",
    "t_pose",
    "bow",
    "sit_to_stand",
    "bend",
    "raise_arms",
    "watch",
    "practise",
    "perform",
];
/// Poses that somebody may take instead of what is asked.
const POSES: [(&str, Stays); 4] = [
    ("n_pose", Stays::NPose),
    ("t_pose", Stays::TPose),
    ("arms_forward", Stays::ArmsForward),
    ("sit", Stays::Sit),
];

/// What goes wrong.
#[derive(Clone, Debug)]
pub enum Wrong {
    /// The person stumbles.
    Stumble,
    /// Two sensors change places.
    Swap(Segment, Segment),
    /// A sensor is pulled out for so long, s.
    Lose(Segment, f64),
    /// What is asked is not done for so long, s.
    Late(f64),
    /// Something else is done than what is asked: what, and in a word.
    Instead(Act, String),
}

/// When it goes wrong.
#[derive(Clone, Debug, PartialEq)]
pub enum Occasion {
    /// So long after the person was there, s.
    At(f64),
    /// So long after this was asked for the so manieth time, s.
    Asked(String, u64, f64),
}

/// Something that goes wrong once.
#[derive(Clone, Debug)]
pub struct Mishap {
    /// What.
    pub wrong: Wrong,
    /// When.
    pub occasion: Occasion,
}

/// What goes wrong, and the seed of what the script does not say.
#[derive(Clone, Debug, Default)]
pub struct MishapScript {
    /// Of the direction of stumbles.
    pub seed: u64,
    /// Each of them.
    pub mishaps: Vec<Mishap>,
}

/// A script as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default)]
    seed: u64,
    #[serde(default)]
    mishap: Vec<WrittenMishap>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenMishap {
    kind: String,
    at_s: Option<f64>,
    asked: Option<String>,
    number: Option<u64>,
    after_s: Option<f64>,
    segments: Option<[String; 2]>,
    segment: Option<String>,
    for_s: Option<f64>,
    instead: Option<String>,
}

impl MishapScript {
    /// Reads a script.
    ///
    /// # Errors
    /// A file that cannot be read or is no script, and says where.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let file = path.display().to_string();
        Self::parse(&gaitway_profiles::read_text(path)?, &file)
    }

    /// Reads the text of a script.
    ///
    /// # Errors
    /// What is no script, and says where.
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let what = "the script of a virtual person has errors";
        let written: Written = from_toml(text).map_err(|e| {
            let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            Error::of(ErrorKind::Malformed, what)
                .at(format!("{file}, line {line}"))
                .got(plain_words(e.message()).replace('\n', "; "))
        })?;
        if written.mishap.len() > MOST {
            return Err(Error::of(ErrorKind::Malformed, what)
                .at(file)
                .got(format!("{} [[mishap]]", written.mishap.len()))
                .allowed(format!("at most {MOST}")));
        }
        let mishaps = written.mishap.iter().enumerate().map(|(n, mishap)| {
            mishap.read().map_err(|wrong| {
                let place = format!("{file}, [[mishap]] {}, {}", n + 1, wrong.key);
                let error = Error::of(ErrorKind::Malformed, what).at(place);
                error.got(wrong.got).allowed(wrong.allowed)
            })
        });
        Ok(Self { seed: written.seed, mishaps: mishaps.collect::<Result<_, _>>()? })
    }
}

/// What is wrong with a mishap as it is written.
struct Unread {
    key: &'static str,
    got: String,
    allowed: String,
}

fn unread(key: &'static str, got: impl Into<String>, allowed: impl Into<String>) -> Unread {
    Unread { key, got: got.into(), allowed: allowed.into() }
}

fn seconds(key: &'static str, value: f64) -> Result<f64, Unread> {
    match (0.0..=LONGEST_S).contains(&value) {
        true => Ok(value),
        false => Err(unread(key, value.to_string(), format!("0 to {LONGEST_S} s"))),
    }
}

fn segment(key: &'static str, name: &str) -> Result<Segment, Unread> {
    segment_named(name).map_err(|error| {
        let allowed = Segment::ALL.map(crate::body::segment_name).join(", ");
        unread(key, error.got.map_or_else(|| name.to_owned(), String::from), allowed)
    })
}

impl WrittenMishap {
    fn read(&self) -> Result<Mishap, Unread> {
        let occasion = self.occasion()?;
        let length = || {
            let value = self.for_s.ok_or_else(|| unread("for_s", "nothing", "a time, s"))?;
            seconds("for_s", value)
        };
        let (wrong, keys): (Wrong, &[&str]) = match self.kind.as_str() {
            "stumble" => (Wrong::Stumble, &[]),
            "swap" => {
                let [one, other] = self
                    .segments
                    .as_ref()
                    .ok_or_else(|| unread("segments", "nothing", "two segments"))?;
                let (one, other) = (segment("segments", one)?, segment("segments", other)?);
                if one == other {
                    return Err(unread("segments", "one segment twice", "two segments"));
                }
                (Wrong::Swap(one, other), &["segments"])
            }
            "lose" => {
                let name = self.segment.as_ref();
                let name = name.ok_or_else(|| unread("segment", "nothing", "a segment"))?;
                (Wrong::Lose(segment("segment", name)?, length()?), &["segment", "for_s"])
            }
            "late" => (Wrong::Late(length()?), &["for_s"]),
            "wrong" => {
                let word = self.instead.as_deref().unwrap_or("nothing");
                let held = POSES.iter().find(|(known, _)| *known == word);
                let moved = MOVEMENTS.iter().find(|(known, _)| *known == word);
                let held = held.map(|(_, stays)| Act::Stay(*stays));
                let moved: Option<(_, Movement)> = moved.copied();
                let act = held.or(moved.map(|(_, movement)| Act::Move(movement)));
                let known = POSES.iter().map(|(name, _)| *name);
                let known: Vec<&str> = known.chain(MOVEMENTS.map(|(name, _)| name)).collect();
                let act = act.ok_or_else(|| unread("instead", word, known.join(", ")))?;
                (Wrong::Instead(act, word.to_owned()), &["instead"])
            }
            other => {
                return Err(unread("kind", other, "stumble, swap, lose, late, wrong"));
            }
        };
        let given = [
            ("segments", self.segments.is_some()),
            ("segment", self.segment.is_some()),
            ("for_s", self.for_s.is_some()),
            ("instead", self.instead.is_some()),
        ];
        if let Some((key, _)) = given.iter().find(|(key, given)| *given && !keys.contains(key)) {
            return Err(unread(key, format!("a {} with {key}", self.kind), "it without"));
        }
        if matches!((&wrong, &occasion), (Wrong::Late(_) | Wrong::Instead(..), Occasion::At(_))) {
            return Err(unread("at_s", self.kind.clone(), "asked = \"t_pose\" and the like"));
        }
        Ok(Mishap { wrong, occasion })
    }

    fn occasion(&self) -> Result<Occasion, Unread> {
        match (&self.asked, self.at_s) {
            (Some(_), Some(_)) | (None, None) => {
                Err(unread("at_s", "when is it?", "either at_s or asked"))
            }
            (None, Some(at_s)) => match (self.number, self.after_s) {
                (None, None) => Ok(Occasion::At(seconds("at_s", at_s)?)),
                _ => Err(unread("number", "at_s with number or after_s", "these with asked")),
            },
            (Some(asked), None) => {
                let known = REQUESTS.contains(&asked.as_str());
                let after_s = seconds("after_s", self.after_s.unwrap_or(0.0))?;
                match (known, self.number.unwrap_or(1)) {
                    (false, _) => Err(unread("asked", asked, REQUESTS.join(", "))),
                    (true, 0) => Err(unread("number", "0", "1 and more")),
                    (true, number) => Ok(Occasion::Asked(asked.clone(), number, after_s)),
                }
            }
        }
    }
}

impl Occasion {
    /// How long after this request it goes wrong, s, if it does.
    #[must_use]
    pub fn after_s(&self, request: &Now) -> Option<f64> {
        match self {
            Self::Asked(asked, number, after_s) => {
                (request.word() == asked && request.times == *number).then_some(*after_s)
            }
            Self::At(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_says_what_goes_wrong_and_when() {
        let script = MishapScript::parse(
            "seed = 3\n\
             [[mishap]]\nkind = 'stumble'\nasked = 'n_pose'\nnumber = 2\nafter_s = 0.5\n\
             [[mishap]]\nkind = 'swap'\nsegments = ['left_shank', 'right_shank']\nat_s = 4\n\
             [[mishap]]\nkind = 'lose'\nsegment = 'torso'\nfor_s = 3\nasked = 'perform'\n\
             [[mishap]]\nkind = 'late'\nfor_s = 2\nasked = 'bow'\n\
             [[mishap]]\nkind = 'wrong'\ninstead = 'sit'\nasked = 't_pose'\n",
            "a.toml",
        );
        let script = script.expect("a script");
        assert_eq!((script.seed, script.mishaps.len()), (3, 5));
        let asked = |wanted, movement: Option<&str>, times| Now {
            wanted,
            movement: movement.map(str::to_owned),
            times,
            ..Now::default()
        };
        use crate::session::now::NowWanted;
        let occasion = |n: usize| &script.mishaps[n].occasion;
        assert_eq!(occasion(0).after_s(&asked(NowWanted::NPose, None, 2)), Some(0.5));
        assert_eq!(occasion(0).after_s(&asked(NowWanted::NPose, None, 1)), None);
        assert_eq!(occasion(0).after_s(&asked(NowWanted::TPose, None, 2)), None);
        assert_eq!(*occasion(1), Occasion::At(4.0));
        assert_eq!(occasion(3).after_s(&asked(NowWanted::Move, Some("bow"), 1)), Some(0.0));
        assert_eq!(occasion(3).after_s(&asked(NowWanted::Move, Some("bend"), 1)), None);
        assert!(matches!(script.mishaps[4].wrong, Wrong::Instead(Act::Stay(Stays::Sit), _)));
    }

    #[test]
    fn a_script_with_errors_says_where_what_and_what_there_could_be() {
        let said = |text: &str| MishapScript::parse(text, "a.toml").expect_err(text).to_string();
        let of = |rest: &str| said(&format!("[[mishap]]\n{rest}"));
        for (text, words) in [
            ("kind = 'fly'\nat_s = 1", "stumble, swap, lose, late, wrong"),
            ("kind = 'stumble'", "either at_s or asked"),
            ("kind = 'stumble'\nat_s = 1\nasked = 'bow'", "either at_s or asked"),
            ("kind = 'stumble'\nat_s = nan", "0 to 86400 s"),
            ("kind = 'stumble'\nat_s = 1\nfor_s = 2", "it without"),
            ("kind = 'stumble'\nasked = 'dance'", "raise_arms"),
            ("kind = 'stumble'\nasked = 'bow'\nnumber = 0", "1 and more"),
            ("kind = 'swap'\nat_s = 1", "two segments"),
            ("kind = 'swap'\nsegments = ['head', 'head']\nat_s = 1", "two segments"),
            ("kind = 'swap'\nsegments = ['head', 'tail']\nat_s = 1", "left_thigh"),
            ("kind = 'lose'\nsegment = 'head'\nat_s = 1", "for_s"),
            ("kind = 'late'\nfor_s = 1\nat_s = 1", "asked ="),
            ("kind = 'wrong'\ninstead = 'fly'\nasked = 'bow'", "arms_forward"),
        ] {
            let said = of(text);
            assert!(said.contains(words) && said.contains("[[mishap]] 1"), "{text}: {said}");
        }
        assert!(said("mishap = 3").contains("line 1"), "{}", said("mishap = 3"));
        assert!(of("kind = 'stumble'\nat_s = 1\nwhy = 'x'").contains("why"));
    }
}
