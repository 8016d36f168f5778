//! A servo's registers by the names their maker gave them.

use crate::error::{Error, ErrorKind};
use gaitway_profiles::{RegisterItem, Role, Servo};

/// A firmware in the maker's form: Feetech's is two numbers.
#[must_use]
pub fn firmware_words(profile: &Servo, firmware: u16) -> String {
    if profile.register(Role::FirmwareVersionMinor).is_some() {
        format!("{}.{}", firmware >> 8, firmware & 0xFF)
    } else {
        firmware.to_string()
    }
}

/// True for the many registers that only stand for others.
pub fn is_indirect(item: &RegisterItem<'_>) -> bool {
    matches!(item.register.role, Some(Role::IndirectAddress | Role::IndirectData))
}

/// The register that `name` means.
///
/// # Errors
/// None, with those that are like it.
pub fn find(servo: &'static Servo, name: &str) -> Result<RegisterItem<'static>, Error> {
    let wanted = plain(name);
    if let Some(item) = servo.items().find(|item| plain(&item.name()) == wanted) {
        return Ok(item);
    }
    // Short words (of, at, id) are in too many names to tell anything.
    let words = name.split([' ', '_', '-']).map(plain).filter(|word| word.len() > 2);
    let words: Vec<String> = words.collect();
    let alike = |item: &RegisterItem<'_>| {
        let known = plain(&item.name());
        let shares_a_word = || words.iter().any(|word| known.contains(word));
        !wanted.is_empty() && (known.contains(&wanted) || shares_a_word())
    };
    let direct = || servo.items().filter(|item| !is_indirect(item));
    let mut near: Vec<String> = direct().filter(alike).map(|item| item.name()).collect();
    if near.is_empty() {
        near = direct().map(|item| item.name()).collect();
    }
    Err(Error::of(ErrorKind::Unknown, "the servo has no such register")
        .at(servo.model.clone())
        .got(name)
        .allowed(near.join(", "))
        .remedy(format!("gaitway profile show {} lists them", servo.name)))
}

/// A name without case, spaces, underscores and hyphens.
pub fn plain(name: &str) -> String {
    let kept = name.chars().filter(|c| !matches!(c, ' ' | '_' | '-'));
    kept.flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_register_is_found_however_its_name_is_typed() {
        let servo = gaitway_profiles::servo("xm430-w350").expect("a shipped servo");
        for name in ["Present Position", "present_position", "PRESENTPOSITION", "present-position"]
        {
            assert_eq!(find(servo, name).expect(name).address, 132);
        }
        assert_eq!(find(servo, "indirect address 3").expect("a repeated one").address, 172);
    }

    #[test]
    fn an_unknown_register_is_answered_with_those_like_it() {
        let servo = gaitway_profiles::servo("xm430-w350").expect("a shipped servo");
        let error = find(servo, "temperature").expect_err("two have that word");
        let said = error.to_string();
        assert!(
            said.contains("Present Temperature") && said.contains("Temperature Limit"),
            "{said}"
        );
        assert!(find(servo, "").is_err());
        let error = find(servo, "Present Temprature").expect_err("a slip of the finger");
        assert!(error.to_string().contains("Present Temperature"), "{error}");
    }
}
