//! A virtual robot behind a pseudo-terminal, and a program that opens it like any serial port.
//!
//! Run with `cargo run -p gaitway-sim --example terminal`.

use gaitway_sim::{Door, Options, World, profiles};
use std::error::Error;
use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::sync::{Arc, Mutex};

fn main() -> Result<(), Box<dyn Error>> {
    let robot = profiles::robot("open-duck-mini-v2")?;
    let world = Arc::new(Mutex::new(World::new(&robot, Options::default())?));
    let door = Door::open(Arc::clone(&world), 0, None)?;
    println!("open {} with any program, at 1000000 baud", door.path().display());

    // The terminal is raw and at the line's speed already.
    let mut port = OpenOptions::new().read(true).write(true).open(door.path())?;
    // FEETECH: ping ID 20.
    port.write_all(&[0xFF, 0xFF, 20, 2, 1, !23])?;
    let mut status = [0; 6];
    port.read_exact(&mut status)?;
    assert_eq!(status, [0xFF, 0xFF, 20, 2, 0, !22]);
    println!("servo 20 answered {status:02X?}");
    Ok(())
}
