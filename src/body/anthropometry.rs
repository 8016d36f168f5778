//! Who moves: a person's measures, as a motion database keeps them.
//!
//! Which measures, and how they are taken, is the usual marker set's (Vicon, "Plug-in Gait Reference
//! Guide", subject measurements): leg length from the front of the hip bone to the inner ankle,
//! widths across the joint. The ranges are ours; they are wider than people are, and keep
//! centimetres from being taken for metres.

use crate::body::Proportions;
use crate::error::{Error, ErrorKind, counted};
use crate::toml_text::{from_toml, plain_words};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// A person who is recorded. What was not measured is not there, never a guess.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subject {
    /// Name in files: small letters, digits and `-`. No real name needs to be told.
    pub id: String,
    /// Gender, in the subject's words.
    #[serde(default)]
    pub gender: String,
    /// Anything else: actions that are not possible, injuries.
    #[serde(default)]
    pub remarks: String,
    /// What was measured, in SI; age in years.
    pub measures: BTreeMap<Measure, f64>,
}

/// What is measured, in the order in which a person is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Measure {
    #[serde(rename = "age_years")]
    Age,
    #[serde(rename = "stature_m")]
    Stature,
    #[serde(rename = "mass_kg")]
    Mass,
    #[serde(rename = "left_leg_length_m")]
    LeftLegLength,
    #[serde(rename = "right_leg_length_m")]
    RightLegLength,
    #[serde(rename = "left_knee_width_m")]
    LeftKneeWidth,
    #[serde(rename = "right_knee_width_m")]
    RightKneeWidth,
    #[serde(rename = "left_ankle_width_m")]
    LeftAnkleWidth,
    #[serde(rename = "right_ankle_width_m")]
    RightAnkleWidth,
    #[serde(rename = "left_elbow_width_m")]
    LeftElbowWidth,
    #[serde(rename = "right_elbow_width_m")]
    RightElbowWidth,
    #[serde(rename = "left_wrist_width_m")]
    LeftWristWidth,
    #[serde(rename = "right_wrist_width_m")]
    RightWristWidth,
    #[serde(rename = "left_shoulder_offset_m")]
    LeftShoulderOffset,
    #[serde(rename = "right_shoulder_offset_m")]
    RightShoulderOffset,
    #[serde(rename = "left_hand_thickness_m")]
    LeftHandThickness,
    #[serde(rename = "right_hand_thickness_m")]
    RightHandThickness,
}

/// Units of an answer, each with what it is in SI.
type Units = &'static [(&'static str, f64)];

const METRES: Units = &[("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)];
const KILOGRAMS: Units = &[("kg", 1.0)];
const YEARS: Units = &[("years", 1.0), ("y", 1.0)];

impl Measure {
    /// All of them.
    pub const ALL: [Self; 17] = [
        Self::Age,
        Self::Stature,
        Self::Mass,
        Self::LeftLegLength,
        Self::RightLegLength,
        Self::LeftKneeWidth,
        Self::RightKneeWidth,
        Self::LeftAnkleWidth,
        Self::RightAnkleWidth,
        Self::LeftElbowWidth,
        Self::RightElbowWidth,
        Self::LeftWristWidth,
        Self::RightWristWidth,
        Self::LeftShoulderOffset,
        Self::RightShoulderOffset,
        Self::LeftHandThickness,
        Self::RightHandThickness,
    ];

    /// What it is called, and how it is taken.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Age => "age",
            Self::Stature => "stature (body height, without shoes)",
            Self::Mass => "mass",
            Self::LeftLegLength => "left leg length (front of the hip bone to the inner ankle)",
            Self::RightLegLength => "right leg length",
            Self::LeftKneeWidth => "left knee width",
            Self::RightKneeWidth => "right knee width",
            Self::LeftAnkleWidth => "left ankle width",
            Self::RightAnkleWidth => "right ankle width",
            Self::LeftElbowWidth => "left elbow width",
            Self::RightElbowWidth => "right elbow width",
            Self::LeftWristWidth => "left wrist thickness",
            Self::RightWristWidth => "right wrist thickness",
            Self::LeftShoulderOffset => "left shoulder offset (top of the shoulder to its centre)",
            Self::RightShoulderOffset => "right shoulder offset",
            Self::LeftHandThickness => "left hand thickness",
            Self::RightHandThickness => "right hand thickness",
        }
    }

    /// What is plausible, in [`Self::unit`].
    #[must_use]
    pub const fn range(self) -> RangeInclusive<f64> {
        match self {
            Self::Age => 1.0..=120.0,
            Self::Stature => 0.5..=2.5,
            Self::Mass => 3.0..=300.0,
            Self::LeftLegLength | Self::RightLegLength => 0.2..=1.4,
            Self::LeftKneeWidth | Self::RightKneeWidth => 0.04..=0.20,
            Self::LeftAnkleWidth | Self::RightAnkleWidth => 0.03..=0.15,
            Self::LeftElbowWidth | Self::RightElbowWidth => 0.03..=0.15,
            Self::LeftWristWidth | Self::RightWristWidth => 0.02..=0.10,
            Self::LeftShoulderOffset | Self::RightShoulderOffset => 0.01..=0.12,
            Self::LeftHandThickness | Self::RightHandThickness => 0.01..=0.08,
        }
    }

    /// The unit it is kept in.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Age => "years",
            Self::Mass => "kg",
            _ => "m",
        }
    }

    /// True if a session cannot do without it.
    #[must_use]
    pub const fn is_required(self) -> bool {
        matches!(self, Self::Stature)
    }

    /// What it and its like on the other side are called, and which part of the stature is usual: legs as people's are, the others
    /// from half to twice what the usual marker set's widths are of a person of 1.7 m (100 mm at the knee, 70 at the ankle,
    /// 80 at the elbow, 60 at the wrist, 40 at the shoulder, 25 at the hand).
    const fn share(self) -> Option<(&'static str, RangeInclusive<f64>)> {
        Some(match self {
            Self::Age | Self::Stature | Self::Mass => return None,
            Self::LeftLegLength | Self::RightLegLength => ("legs", 0.40..=0.65),
            Self::LeftKneeWidth | Self::RightKneeWidth => ("knees", 0.03..=0.12),
            Self::LeftAnkleWidth | Self::RightAnkleWidth => ("ankles", 0.02..=0.085),
            Self::LeftElbowWidth | Self::RightElbowWidth => ("elbows", 0.023..=0.095),
            Self::LeftWristWidth | Self::RightWristWidth => ("wrists", 0.017..=0.07),
            Self::LeftShoulderOffset | Self::RightShoulderOffset => {
                ("shoulder offsets", 0.01..=0.05)
            }
            Self::LeftHandThickness | Self::RightHandThickness => ("hands", 0.007..=0.03),
        })
    }

    /// The same on the other side, and which side that is.
    const fn twin(self) -> Option<(Self, &'static str)> {
        const LEFT: &str = "left";
        const RIGHT: &str = "right";
        Some(match self {
            Self::Age | Self::Stature | Self::Mass => return None,
            Self::LeftLegLength => (Self::RightLegLength, RIGHT),
            Self::RightLegLength => (Self::LeftLegLength, LEFT),
            Self::LeftKneeWidth => (Self::RightKneeWidth, RIGHT),
            Self::RightKneeWidth => (Self::LeftKneeWidth, LEFT),
            Self::LeftAnkleWidth => (Self::RightAnkleWidth, RIGHT),
            Self::RightAnkleWidth => (Self::LeftAnkleWidth, LEFT),
            Self::LeftElbowWidth => (Self::RightElbowWidth, RIGHT),
            Self::RightElbowWidth => (Self::LeftElbowWidth, LEFT),
            Self::LeftWristWidth => (Self::RightWristWidth, RIGHT),
            Self::RightWristWidth => (Self::LeftWristWidth, LEFT),
            Self::LeftShoulderOffset => (Self::RightShoulderOffset, RIGHT),
            Self::RightShoulderOffset => (Self::LeftShoulderOffset, LEFT),
            Self::LeftHandThickness => (Self::RightHandThickness, RIGHT),
            Self::RightHandThickness => (Self::LeftHandThickness, LEFT),
        })
    }

    /// A value with its unit, as it is said.
    #[must_use]
    pub fn said(self, value: f64) -> String {
        format!("{value} {}", self.unit())
    }

    const fn units(self) -> Units {
        match self {
            Self::Age => YEARS,
            Self::Mass => KILOGRAMS,
            _ => METRES,
        }
    }

    /// What may be answered, for a person who is asked.
    #[must_use]
    pub fn allowed(self) -> String {
        let (range, unit) = (self.range(), self.unit());
        let units = match self.units() {
            METRES => "; 3 cm and 30 mm are understood",
            _ => "",
        };
        format!("{} to {} {unit}{units}", range.start(), range.end())
    }

    /// Reads an answer: a number in [`Self::unit`], or with a unit behind it.
    ///
    /// # Errors
    /// No number, an unknown unit, a value that no person has.
    pub fn read(self, answer: &str) -> Result<f64, Error> {
        let text = answer.trim().replace(',', ".");
        let refused = |what: &str| {
            Error::new(format!("{}: {what}", self.words())).got(answer).allowed(self.allowed())
        };
        let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let unit = text[digits.len()..].to_ascii_lowercase();
        if digits.trim().is_empty() {
            return Err(refused("not a number"));
        }
        let in_si = match unit.as_str() {
            "" => Some(1.0),
            unit => self.units().iter().find(|(name, _)| *name == unit).map(|(_, si)| *si),
        };
        let in_si = in_si.ok_or_else(|| refused("not a unit of this measure"))?;
        let value: f64 = digits.trim().parse().map_err(|_| refused("not a number"))?;
        let value = value * in_si;
        if !self.range().contains(&value) {
            return Err(refused("not a plausible measure"));
        }
        Ok(value)
    }
}

/// Longest id, letters.
const LONGEST_ID: usize = 32;

/// Checks a subject's id.
///
/// # Errors
/// One that is empty, too long, or could not be a file's name everywhere.
pub fn check_id(id: &str) -> Result<(), Error> {
    let fits = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
    if !id.is_empty() && id.len() <= LONGEST_ID && id.bytes().all(fits) && !id.starts_with('-') {
        return Ok(());
    }
    Err(Error::new("not an id")
        .got(id)
        .allowed("1 to 32 of a-z, 0-9 and -, such as s01; a real name is not needed"))
}

impl Subject {
    /// Reads the file of a subject.
    ///
    /// # Errors
    /// What is not one, and says where.
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let subject: Self = from_toml(text).map_err(|e| {
            let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            Error::of(ErrorKind::Malformed, "not the file of a subject")
                .at(format!("{file}, line {line}"))
                .got(plain_words(e.message()).replace('\n', "; "))
        })?;
        subject.check().map_err(|e| e.at(file))?;
        Ok(subject)
    }

    /// A measure, in its unit.
    #[must_use]
    pub fn measure(&self, measure: Measure) -> Option<f64> {
        self.measures.get(&measure).copied()
    }

    /// Checks every measure, as of a file that somebody edited.
    ///
    /// # Errors
    /// An id that is none, no stature, a measure that no person has.
    pub fn check(&self) -> Result<(), Error> {
        check_id(&self.id)?;
        self.proportions()?;
        for measure in Measure::ALL {
            let Some(value) = self.measure(measure) else { continue };
            measure.read(&value.to_string())?;
        }
        Ok(())
    }

    /// What makes a measure doubtful beside the others, if anything does: each is plausible alone.
    #[must_use]
    pub fn doubt(&self, measure: Measure) -> Option<String> {
        use Measure as M;
        let value = self.measure(measure)?;
        match measure {
            M::Age => of_age(self.measure(M::Stature)?, value),
            M::Stature => {
                let of_age = self.measure(M::Age).and_then(|years| of_age(value, years));
                let of_mass = || self.measure(M::Mass).and_then(|mass_kg| of_mass(mass_kg, value));
                let others = M::ALL.into_iter().filter(|other| other.share().is_some());
                let of_others =
                    || others.filter_map(|other| of_stature(other, self.measure(other)?, value));
                of_age.or_else(of_mass).or_else(|| of_others().next())
            }
            M::Mass => of_mass(value, self.measure(M::Stature)?),
            other => {
                let twin =
                    other.twin().and_then(|(twin, side)| uneven(value, side, self.measure(twin)?));
                twin.or_else(|| of_stature(other, value, self.measure(M::Stature)?))
            }
        }
    }

    /// Mean length of the legs that were measured, m.
    #[must_use]
    pub fn leg_length_m(&self) -> Option<f64> {
        let both = [Measure::LeftLegLength, Measure::RightLegLength];
        let known: Vec<f64> = both.iter().filter_map(|leg| self.measure(*leg)).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }

    /// The body that angles are put on: its parts follow from the stature, its mass and its legs from what
    /// was measured, where it was (see [`Proportions`]).
    ///
    /// # Errors
    /// A stature that is missing or that no person has, a mass that none has, legs that do not go with it.
    pub fn proportions(&self) -> Result<Proportions, Error> {
        let stature_m = self.measure(Measure::Stature);
        let missing = || Error::new("the stature is missing").at(format!("subject {}", self.id));
        let mut body = Proportions::of_stature(stature_m.ok_or_else(missing)?)?;
        if let Some(mass_kg) = self.measure(Measure::Mass) {
            body = body.with_mass_kg(mass_kg)?;
        }
        self.leg_length_m().map_or(Ok(body), |length_m| body.with_leg_length_m(length_m))
    }
}

/// Whole range in which people live, kg/m² (WHO, "Physical status", Technical Report 854, 1995: below 16 is severe thinness, from
/// 40 on the highest class of obesity), and a third beyond.
const BODY_MASS_INDEX: std::ops::RangeInclusive<f64> = 11.0..=60.0;
/// Adults are short from here on down, m (Little People of America: 4'10"), and asked about from a good deal below.
const SHORT_ADULT_M: f64 = 1.30;
const ADULT_YEARS: f64 = 18.0;

/// Adults are rarely so short, children hardly ever so tall: WHO Child Growth Standards and Growth Reference, three standard deviations
/// above the mean, boys: about 1.24 m at five years, 1.57 m at ten, 1.92 m at fifteen.
fn of_age(stature_m: f64, years: f64) -> Option<String> {
    let tallest_m = 0.98 + 0.07 * years;
    if years >= ADULT_YEARS {
        (stature_m < SHORT_ADULT_M)
            .then(|| format!("few people of {years} are so short", years = counted(years, "year")))
    } else {
        (stature_m > tallest_m).then(|| {
            format!("hardly any child of {years} is so tall", years = counted(years, "year"))
        })
    }
}

fn of_mass(mass_kg: f64, stature_m: f64) -> Option<String> {
    let index = mass_kg / (stature_m * stature_m);
    (!(BODY_MASS_INDEX.contains(&index))).then(|| {
        format!(
            "somebody of {stature_m} m and {mass_kg} kg would have {index:.0} kg/m², {} to {} are usual",
            BODY_MASS_INDEX.start(),
            BODY_MASS_INDEX.end()
        )
    })
}

/// A length beside the stature.
fn of_stature(measure: Measure, value_m: f64, stature_m: f64) -> Option<String> {
    let (what, usual) = measure.share()?;
    let share = value_m / stature_m;
    let percent = |share: f64| match share >= 0.1 {
        true => format!("{:.0}", share * 100.0),
        false => format!("{:.1}", share * 100.0),
    };
    (!usual.contains(&share)).then(|| {
        format!(
            "{value_m} m for {what} would be {} % of the stature, {} to {} % are usual",
            percent(share),
            percent(*usual.start()),
            percent(*usual.end())
        )
    })
}

/// Two sides of a person differ by less than half.
fn uneven(value_m: f64, other_side: &str, other_m: f64) -> Option<String> {
    let ratio = value_m / other_m;
    (!(0.67..=1.5).contains(&ratio)).then(|| format!("the {other_side} one is {other_m} m"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(stature_m: f64) -> Subject {
        let measures = BTreeMap::from([(Measure::Stature, stature_m)]);
        Subject { id: "s01".into(), measures, ..Subject::default() }
    }

    #[test]
    fn answers_with_units_mean_the_same_and_others_are_refused() {
        for answer in ["1.75", " 1,75 ", "175 cm", "1750mm", "1.75 m", "175CM"] {
            assert!((Measure::Stature.read(answer).unwrap() - 1.75).abs() < 1e-12, "{answer}");
        }
        assert_eq!(Measure::Age.read("30"), Ok(30.0));
        assert_eq!(Measure::Mass.read("70.5 kg"), Ok(70.5));
        for answer in ["175", "-1.75", "tall", "", "1.75 kg", "nan", "inf", "1.7.5", "cm"] {
            let error = Measure::Stature.read(answer).unwrap_err();
            assert!(error.allowed.is_some_and(|a| a.contains("0.5 to 2.5 m")), "{answer}");
        }
    }

    #[test]
    fn what_is_plausible_alone_may_be_doubtful_beside_the_rest() {
        let mut subject = person(1.8);
        assert_eq!(subject.check(), Ok(()));
        subject.measures.insert(Measure::LeftLegLength, 0.95);
        assert_eq!(subject.doubt(Measure::LeftLegLength), None);
        subject.measures.insert(Measure::LeftLegLength, 0.5);
        assert!(subject.doubt(Measure::LeftLegLength).unwrap().contains("28 %"));
        assert_eq!(subject.check(), Ok(()), "doubt is for the person who measures");
        assert!(subject.proportions().is_ok(), "some people have short legs");
        subject.measures.insert(Measure::LeftLegLength, 9.5);
        assert!(subject.check().is_err());
        subject.measures.insert(Measure::LeftKneeWidth, 0.06);
        subject.measures.insert(Measure::RightKneeWidth, 0.11);
        for knee in [Measure::RightKneeWidth, Measure::LeftKneeWidth] {
            assert!(subject.doubt(knee).is_some_and(|why| why.contains("one is 0.")), "{knee:?}");
        }
    }

    /// Whatever is answered last is asked about, also when something before it is changed.
    #[test]
    fn every_measure_is_held_against_those_that_are_known() {
        let usual = [
            (Measure::Age, 30.0),
            (Measure::Stature, 1.7),
            (Measure::Mass, 65.0),
            (Measure::LeftLegLength, 0.88),
            (Measure::LeftKneeWidth, 0.10),
            (Measure::LeftAnkleWidth, 0.07),
            (Measure::LeftElbowWidth, 0.08),
            (Measure::LeftWristWidth, 0.06),
            (Measure::LeftShoulderOffset, 0.04),
            (Measure::LeftHandThickness, 0.025),
        ];
        let subject = Subject { id: "s01".into(), measures: usual.into(), ..Subject::default() };
        let with = |measure: Measure, value: f64| {
            let mut subject = subject.clone();
            subject.measures.insert(measure, value);
            subject.doubt(measure).is_some()
        };
        assert!(usual.iter().all(|(measure, value)| !with(*measure, *value)));
        for (measure, doubtful) in [
            (Measure::Age, 5.0),
            (Measure::Stature, 0.91),
            (Measure::Stature, 2.45),
            (Measure::Mass, 200.0),
            (Measure::LeftLegLength, 0.6),
            (Measure::RightLegLength, 0.58),
            (Measure::LeftKneeWidth, 0.042),
            (Measure::RightKneeWidth, 0.19),
            (Measure::LeftAnkleWidth, 0.033),
            (Measure::RightAnkleWidth, 0.045),
            (Measure::LeftElbowWidth, 0.031),
            (Measure::RightElbowWidth, 0.14),
            (Measure::LeftWristWidth, 0.025),
            (Measure::RightWristWidth, 0.095),
            (Measure::LeftShoulderOffset, 0.012),
            (Measure::RightShoulderOffset, 0.11),
            (Measure::LeftHandThickness, 0.0105),
            (Measure::RightHandThickness, 0.06),
        ] {
            assert!(with(measure, doubtful), "{measure:?} {doubtful}");
        }
    }

    #[test]
    fn the_file_of_a_subject_is_read_again_and_what_is_none_is_refused_with_its_line() {
        let text = "id = \"s01\"\n\n[measures]\nage_years = 31.0\nstature_m = 1.7\n";
        let subject = Subject::parse(text, "s01.toml").expect("a subject");
        assert_eq!((subject.id.as_str(), subject.measure(Measure::Stature)), ("s01", Some(1.7)));
        for (text, at) in [
            (text.replace("s01", "Anna B"), "s01.toml"),
            (text.replace("1.7", "170"), "s01.toml"),
            (text.replace("stature_m", "height"), "s01.toml, line 5"),
        ] {
            let error = Subject::parse(&text, "s01.toml").expect_err("no subject");
            assert_eq!(error.place.as_deref(), Some(at), "{error}");
        }
    }

    #[test]
    fn who_is_short_for_the_age_tall_for_it_or_heavy_for_the_stature_is_asked_about_again() {
        let doubted = |years: f64, stature_m: f64, mass_kg: f64| {
            let mut subject = person(stature_m);
            subject.measures.insert(Measure::Age, years);
            subject.measures.insert(Measure::Mass, mass_kg);
            [Measure::Stature, Measure::Mass].map(|measure| subject.doubt(measure).is_some())
        };
        assert_eq!(doubted(70.0, 0.91, 14.0), [true, false]);
        assert_eq!(doubted(70.0, 1.60, 60.0), [false, false]);
        assert_eq!(doubted(5.0, 1.10, 19.0), [false, false]);
        assert_eq!(doubted(5.0, 1.75, 60.0), [true, false]);
        assert_eq!(doubted(34.0, 1.75, 700.0 / 4.0), [false, false]);
        // Either may be the one that is wrong.
        assert_eq!(doubted(34.0, 1.75, 17.5), [true, true]);
        assert_eq!(person(0.91).doubt(Measure::Stature), None, "whose age nobody knows");
    }

    #[test]
    fn ids_are_file_names_everywhere() {
        for id in ["s01", "anna-2", "7"] {
            assert_eq!(check_id(id), Ok(()), "{id}");
        }
        for id in ["", "Anna", "a b", "../x", "a/b", "é", "-x", "a.b", &"x".repeat(33)] {
            assert!(check_id(id).is_err(), "{id}");
        }
    }
}
