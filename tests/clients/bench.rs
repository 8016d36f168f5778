//! What a scenario works with: a virtual robot behind pseudo-terminals, the world to look into past
//! the line, and a client in a Python process of its own.

use crate::python::Python;
use gaitway_sim::{Door, Options, World};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard};

/// The client did not get its answer in time. On a machine that stalls this may be the machine's
/// doing, so a scenario that ends with it is run once more, aloud.
#[derive(Debug)]
pub struct Lost(pub String);

/// A virtual robot, one door for each line.
pub struct Bench {
    world: Arc<Mutex<World>>,
    doors: Vec<Door>,
}

impl Bench {
    /// A shipped robot by name, or a file of `tests/clients/robots`.
    pub fn open(robot: &str, options: Options) -> Bench {
        let file = format!("{}/tests/clients/robots/{robot}.toml", env!("CARGO_MANIFEST_DIR"));
        let name = if Path::new(&file).exists() { &file } else { robot };
        let robot = gaitway_profiles::robot(name).expect("a robot");
        let world = World::new(&robot, options).expect("a world");
        let lines = world.line_names().len();
        let world = Arc::new(Mutex::new(world));
        let open = |line| Door::open(Arc::clone(&world), line, None).expect("a door");
        Bench { doors: (0..lines).map(open).collect(), world }
    }

    /// What a program opens to reach a line.
    pub fn port(&self, line: usize) -> &str {
        self.doors[line].path().to_str().expect("a UTF-8 path")
    }

    pub fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().expect("a world")
    }

    /// The raw value a register has in the servo.
    pub fn register(&self, joint: &str, register: &str) -> i64 {
        let value = self.world().register(joint, register);
        value.unwrap_or_else(|| panic!("{joint} has no {register}"))
    }

    /// Puts a raw value into a register past the line.
    pub fn set(&self, joint: &str, register: &str, raw: i64) {
        assert!(self.world().set_register(joint, register, raw), "{joint}, {register} = {raw}");
    }

    /// Waits for what an instruction does that nobody answers.
    pub fn assert_comes_to(&self, joint: &str, register: &str, expected: i64) {
        let there = (0..2000).any(|_| {
            let there = self.register(joint, register) == expected;
            if !there {
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            there
        });
        assert!(there, "{register} of {joint} is {}", self.register(joint, register));
    }

    /// Checks what is in a register of one servo after another.
    pub fn assert_holds(&self, register: &str, expected: &[(&str, i64)]) {
        for &(joint, value) in expected {
            assert_eq!(self.register(joint, register), value, "{register} of {joint}");
        }
    }
}

/// A client in a process of its own that does what it is told, one operation at a time.
pub struct Client {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
}

impl Client {
    /// Starts a script of `tests/clients`.
    pub fn start(python: &Python, script: &str, arguments: &[&str]) -> Client {
        let script = format!("{}/tests/clients/{script}", env!("CARGO_MANIFEST_DIR"));
        let mut command = Command::new(&python.program);
        command.arg("-B").arg(script).args(arguments).env("GAITWAY_BESIDE", &python.beside);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("a Python process");
        let stdin = child.stdin.take().expect("its input");
        let stdout = BufReader::new(child.stdout.take().expect("its output"));
        Client { child, stdin, stdout }
    }

    /// Has an operation done; what the client made of the answer.
    pub fn ask(&mut self, operation: &str, arguments: Value) -> Result<Value, Lost> {
        let (seen, refusal) = self.attempt(operation, arguments.clone())?;
        assert_eq!(refusal, Value::Null, "{operation} {arguments}");
        Ok(seen)
    }

    /// Has an operation done that the client is to complain about; how it does.
    pub fn complaint(&mut self, operation: &str, arguments: Value) -> Result<Value, Lost> {
        let (seen, refusal) = self.attempt(operation, arguments.clone())?;
        assert_ne!(refusal, Value::Null, "{operation} {arguments} gave {seen}");
        Ok(refusal)
    }

    /// What the client saw, and what it complains about.
    fn attempt(&mut self, operation: &str, arguments: Value) -> Result<(Value, Value), Lost> {
        let mut request = vec![json!(operation)];
        request.extend(arguments.as_array().expect("a list of arguments").iter().cloned());
        let sent = writeln!(self.stdin, "{}", Value::Array(request)).and(self.stdin.flush());
        let mut line = String::new();
        if sent.is_err() || self.stdout.read_line(&mut line).is_err() || line.is_empty() {
            return self.gone(operation);
        }
        let mut reply: Value = serde_json::from_str(&line).expect("JSON");
        match reply["lost"].take() {
            Value::Null => Ok((reply["seen"].take(), reply["refused"].take())),
            why => Err(Lost(format!("{operation} {arguments}: {why}"))),
        }
    }

    /// The process has ended: by its own alarm clock, which is a machine that stalls, or by itself.
    fn gone(&mut self, operation: &str) -> Result<(Value, Value), Lost> {
        use std::os::unix::process::ExitStatusExt;
        const SIGALRM: i32 = 14;
        let status = self.child.wait().expect("its end");
        if status.signal() == Some(SIGALRM) {
            return Err(Lost(format!("{operation} never came back")));
        }
        let mut said = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            let _ = stderr.read_to_string(&mut said);
        }
        panic!("the client ended at {operation} ({status}): {said}");
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
