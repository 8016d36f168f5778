//! A browser for a test, if there is one.

use crate::aloud::aloud;
use crate::chromium::Browser;
use crate::program;

/// A browser; a loud word, or a failure where nothing may be missing, if there is none.
pub fn browser(name: &str) -> Option<Browser> {
    match Browser::start(&program::folder(name)) {
        Ok(browser) => Some(browser),
        Err(cause) if std::env::var_os("CI").is_some() => panic!("no Chromium: {cause}"),
        Err(cause) => {
            aloud!(
                "SKIPPED: {name}: no page was opened: {cause}\n  to do: as root, apt-get install \
                 chromium"
            );
            None
        }
    }
}
