//! Scripts of projects, in Lua 5.3, the language of the engine's scripts. They read and set attributes by `getAttr` and `setAttr`. They
//! run only while a project is read; their decisions are written into the passes.
//!
//! Scripts are untrusted. They have no files, no clock and no random numbers. Instructions ([`INSTRUCTIONS`]), memory ([`MEMORY`]) and
//! nesting are bounded. The work of an instruction is bounded too: the libraries of strings and tables are left out, because the work
//! of one call of their functions grows with the values of its arguments.

use crate::guard;
use omnilua::{Error, HostHooks, Lua, LuaVersion, Sandbox, SandboxConfig, Table, TripReason, Value, Variadic};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;

/// Largest file, bytes.
pub(crate) const MAX_FILE: u64 = 1 << 18;
/// Greatest number of instructions of the scripts of a pipeline, all runs together.
const INSTRUCTIONS: u64 = 1_000_000;
/// Greatest number of bytes that the scripts of a pipeline hold.
const MEMORY: usize = 1 << 20;

/// Lua globals that scripts may use, besides `math`, the functions of the engine, and `print` and `io`, which do nothing.
const KEPT: [&str; 9] = ["assert", "error", "ipairs", "next", "pairs", "select", "tonumber", "tostring", "type"];
/// Functions of `math` that scripts may not use: their results would differ each time.
const RANDOM: [&str; 2] = ["random", "randomseed"];
/// Functions of the engine that change no picture. They do nothing here.
const SAVING: [&str; 4] = ["saveTexture", "saveBuffer", "saveProfiler", "screenshot"];
/// Functions of the engine on buffers. Calls are errors: buffers exist only while passes run, and scripts run before the first pass.
const BUFFERS: [&str; 2] = ["getBuffer", "setBuffer"];

/// An attribute, as a script names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Asked {
    /// Kind of the object that has the attribute, such as `PASS`.
    pub kind: String,
    /// The object: `CURRENT` or its name.
    pub context: String,
    /// The attribute.
    pub component: String,
    /// Texture unit, for the kind `IMAGE_TEXTURE`; other kinds ignore it.
    pub id: i64,
}

/// The attributes that scripts read and set.
pub(crate) trait Attributes {
    /// The numbers of an attribute.
    ///
    /// # Errors
    /// If there is no such attribute; the message says what is valid.
    fn get(&self, asked: &Asked) -> Result<Vec<f64>, String>;

    /// Sets an attribute; `values` has as many numbers as [`Self::get`] returns.
    ///
    /// # Errors
    /// If scripts cannot set it, or it cannot have these values.
    fn set(&mut self, asked: &Asked, values: &[f64]) -> Result<(), String>;
}

/// An error of a script.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Fault {
    /// The number of the file, as given to [`Scripts::load`], and the line, counted from 1. `None` if no line caused the error.
    pub place: Option<(u32, usize)>,
    pub message: String,
}

impl Fault {
    fn nowhere(message: impl Into<String>) -> Self {
        Self { place: None, message: message.into() }
    }
}

/// The scripts of a pipeline. Files share their global names, as in the engine.
pub(crate) struct Scripts {
    lua: Lua,
    sandbox: Sandbox,
    left_out: Rc<RefCell<BTreeSet<&'static str>>>,
}

impl Scripts {
    /// An interpreter on these attributes, without scripts yet.
    ///
    /// # Errors
    /// If the interpreter cannot start.
    pub fn new<A: Attributes + 'static>(attributes: &Rc<RefCell<A>>) -> Result<Self, Fault> {
        let started = guard::call("omnilua", || Self::start(attributes));
        started.map_err(Fault::nowhere)?.map_err(|error| Fault::nowhere(error.to_string()))
    }

    fn start<A: Attributes + 'static>(attributes: &Rc<RefCell<A>>) -> Result<Self, Error> {
        let lua = Lua::with_hooks_versioned(HostHooks::default(), LuaVersion::V53)?;
        let globals = lua.globals();
        let math: Table = globals.get("math")?;
        // The metatable of strings refers to the table `string` even without the global name, so the table itself is emptied.
        strip(&globals.get::<_, Table>("string")?, |_| false)?;
        strip(&math, |name| !RANDOM.contains(&name))?;
        strip(&globals, |name| KEPT.contains(&name) || name == "math")?;
        lua.set_capture_tracebacks(true);
        let left_out = Rc::new(RefCell::new(BTreeSet::new()));
        for name in SAVING {
            globals.set(name, nothing(&lua, name, &left_out)?)?;
        }
        globals.set("print", lua.create_function(|_, _: Variadic<Value>| Ok(()))?)?;
        globals.set("io", files(&lua, &left_out)?)?;
        for name in BUFFERS {
            let refused = move |_: &Lua, _: Variadic<Value>| -> Result<(), Error> {
                Err(failed(format!(
                    "`{name}`: buffers are not there while scripts run, which is before the first pass"
                )))
            };
            globals.set(name, lua.create_function(refused)?)?;
        }
        let from = Rc::clone(attributes);
        let get = lua.create_function(move |_, given: Variadic<Value>| {
            let (asked, table) = asked("getAttr", &given)?;
            let values = from.borrow().get(&asked).map_err(failed)?;
            (1..).zip(values).try_for_each(|(place, value): (i64, f64)| table.set(place, value))
        })?;
        globals.set("getAttr", get)?;
        let into = Rc::clone(attributes);
        let set = lua.create_function(move |_, given: Variadic<Value>| {
            let (asked, table) = asked("setAttr", &given)?;
            let count = into.borrow().get(&asked).map_err(failed)?.len();
            let values: Option<Vec<f64>> = (1..=count as i64).map(|place| number(&table.get(place).ok()?)).collect();
            let Some(values) = values else {
                let what = if count == 1 { "a number".to_owned() } else { format!("{count} numbers") };
                return Err(failed(format!("`{}` of {} takes a table with {what}", asked.component, asked.kind)));
            };
            into.borrow_mut().set(&asked, &values).map_err(failed)
        })?;
        globals.set("setAttr", set)?;
        let sandbox = lua.install_sandbox(SandboxConfig {
            instruction_limit: Some(INSTRUCTIONS),
            memory_limit_bytes: Some(MEMORY),
            check_interval: 1,
            remove_globals: Vec::new(),
        })?;
        Ok(Self { lua, sandbox, left_out })
    }

    /// Runs the source of a file, which defines functions. `file` is the file's number in faults.
    ///
    /// # Errors
    /// If the source is not valid Lua, or running it fails.
    pub fn load(&self, file: u32, text: &str) -> Result<(), Fault> {
        // Compiled code starts with this byte. It is refused: its effect on an interpreter that trusts its compiler is not known.
        if text.starts_with('\x1b') {
            return Err(Fault::nowhere("it is compiled; valid: the text of a script"));
        }
        self.guarded(|| self.lua.load(text).set_name(format!("={file}")).exec())
    }

    /// Calls a function without arguments.
    ///
    /// # Errors
    /// If there is no such function, or it fails.
    pub fn call(&self, name: &str) -> Result<(), Fault> {
        self.returned(name).map(drop)
    }

    /// Calls a function without arguments and returns its boolean result.
    ///
    /// # Errors
    /// If there is no such function, it fails, or its result is no boolean.
    pub fn test(&self, name: &str) -> Result<bool, Fault> {
        match self.returned(name)? {
            Value::Boolean(answer) => Ok(answer),
            _ => Err(Fault::nowhere(format!("`{name}` returns neither true nor false"))),
        }
    }

    fn returned(&self, name: &str) -> Result<Value, Fault> {
        // Frees the garbage of earlier calls.
        self.lua.gc_collect();
        match self.guarded(|| self.lua.globals().get::<_, Value>(name))? {
            Value::Function(function) => self.guarded(|| function.call::<_, Value>(())),
            _ => Err(Fault::nowhere(format!("there is no function `{name}`"))),
        }
    }

    /// The engine's functions that do nothing here and were called since the last call of this method.
    pub fn left_out(&self) -> BTreeSet<&'static str> {
        std::mem::take(&mut self.left_out.borrow_mut())
    }

    fn guarded<T>(&self, run: impl FnOnce() -> Result<T, Error>) -> Result<T, Fault> {
        guard::call("omnilua", run).map_err(Fault::nowhere)?.map_err(|error| self.fault(&error))
    }

    /// The fault of an error, whose message or traceback names the place: `3:12: message`.
    fn fault(&self, error: &Error) -> Fault {
        let text = error.to_string();
        let traceback = error.traceback_lossy().unwrap_or_default();
        let (mut place, mut message) = match placed(&text) {
            Some((place, message)) => (Some(place), message.to_owned()),
            None => (traceback.lines().find_map(|line| Some(placed(line.trim())?.0)), text),
        };
        match self.sandbox.tripped() {
            Some(TripReason::Instructions) => {
                message = format!("the scripts of the pipeline take more than {INSTRUCTIONS} instructions");
            }
            Some(TripReason::Memory) => {
                message = format!("the scripts of the pipeline hold more than {} KiB", MEMORY >> 10);
            }
            None => {}
        }
        place = place.filter(|(_, line)| *line > 0);
        Fault { place, message }
    }
}

/// File and line in front of a message, and the message.
fn placed(text: &str) -> Option<((u32, usize), &str)> {
    let mut parts = text.splitn(3, ':');
    let place = (parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
    Some((place, parts.next()?.trim()))
}

/// Removes all entries from a table except those that are `kept`.
fn strip(table: &Table, kept: impl Fn(&str) -> bool) -> Result<(), Error> {
    for pair in table.pairs()?.collect::<Vec<_>>() {
        let (key, _): (Value, Value) = pair?;
        let name = match &key {
            Value::String(name) => name.to_str()?,
            _ => String::new(),
        };
        if !kept(&name) {
            table.set(key, Value::Nil)?;
        }
    }
    Ok(())
}

/// A function that does nothing but record that it was called.
fn nothing(
    lua: &Lua,
    name: &'static str,
    left_out: &Rc<RefCell<BTreeSet<&'static str>>>,
) -> Result<omnilua::Function, Error> {
    let left_out = Rc::clone(left_out);
    lua.create_function(move |_, _: Variadic<Value>| {
        left_out.borrow_mut().insert(name);
        Ok(())
    })
}

/// The table `io`. Its `open` makes a file that discards what is written. `open` makes a new file for each call: a function that held a
/// file would hold the interpreter, which holds the function, and neither would ever be freed.
fn files(lua: &Lua, left_out: &Rc<RefCell<BTreeSet<&'static str>>>) -> Result<Table, Error> {
    let io = lua.create_table()?;
    let left_out = Rc::clone(left_out);
    let open = lua.create_function(move |lua, _: Variadic<Value>| {
        let file = lua.create_table()?;
        for name in ["write", "flush", "close"] {
            file.set(name, nothing(lua, "io.open", &left_out)?)?;
        }
        Ok(file)
    })?;
    io.set("open", open)?;
    Ok(io)
}

/// The arguments of `getAttr` and `setAttr`.
fn asked(function: &str, given: &[Value]) -> Result<(Asked, Table), Error> {
    let text = |value: &Value| match value {
        Value::String(text) => text.to_str().ok(),
        _ => None,
    };
    if let [kind, context, component, id, Value::Table(table)] = given
        && let (Some(kind), Some(context), Some(component), Some(id)) =
            (text(kind), text(context), text(component), number(id))
    {
        return Ok((Asked { kind, context, component, id: id as i64 }, table.clone()));
    }
    Err(failed(format!(
        "`{function}` takes a type, a context, a component, an id and a table: {function}(\"PASS\", \"CURRENT\", \"DIM_X\", 0, t)"
    )))
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(number) => Some(*number as f64),
        Value::Number(number) => Some(*number),
        _ => None,
    }
}

fn failed(message: String) -> Error {
    omnilua::LuaError::runtime(format_args!("{message}")).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[derive(Debug, Default)]
    struct Numbers(BTreeMap<String, Vec<f64>>);

    impl Attributes for Numbers {
        fn get(&self, asked: &Asked) -> Result<Vec<f64>, String> {
            self.0.get(&asked.component).cloned().ok_or_else(|| format!("no `{}`", asked.component))
        }

        fn set(&mut self, asked: &Asked, values: &[f64]) -> Result<(), String> {
            self.0.insert(format!("{} {} {}", asked.kind, asked.context, asked.id), values.to_vec());
            Ok(())
        }
    }

    #[test]
    fn scripts_get_and_set_what_they_name() {
        let numbers = Rc::new(RefCell::new(Numbers(BTreeMap::from([("TWO".to_owned(), vec![1.5, 2.0])]))));
        let scripts = Scripts::new(&numbers).expect("it starts");
        let text = "function swap() local t = {} getAttr('A', 'B', 'TWO', 0, t)\n setAttr('K', 'C', 'TWO', 7, {t[2], t[1], 9}) end";
        scripts.load(4, text).expect("it is Lua");
        scripts.call("swap").expect("it runs");
        assert_eq!(numbers.borrow().0["K C 7"], [2.0, 1.5]);
        let place = |text: &str| scripts.load(5, text).expect_err("it fails").place;
        assert_eq!(place("\n\nlocal a = nil + 1"), Some((5, 3)));
        assert_eq!(place("swap()\n\n\ngetAttr('A', 'B', 'THREE', 0, {})"), Some((5, 4)));
        let compiled = scripts.load(5, "\x1bLua").expect_err("it is no text");
        assert_eq!((compiled.place, &compiled.message[..14]), (None, "it is compiled"));
    }

    #[test]
    fn an_interpreter_that_is_dropped_is_freed() {
        let numbers = Rc::<RefCell<Numbers>>::default();
        let scripts = Scripts::new(&numbers).expect("it starts");
        scripts.load(0, "local file = io.open('a', 'w') file:write('b') file:close()").expect("it is Lua");
        assert_eq!(scripts.left_out(), BTreeSet::from(["io.open"]));
        assert!(Rc::strong_count(&numbers) > 1, "its functions hold the attributes");
        drop(scripts);
        assert_eq!(Rc::strong_count(&numbers), 1);
    }

    #[test]
    fn a_panic_of_the_interpreter_is_a_fault() {
        let start = || Scripts::new(&Rc::<RefCell<Numbers>>::default()).map(drop);
        start().expect("it starts");
        let fault = guard::plant::in_crate("omnilua", start).expect_err("a panic");
        assert!(fault.message.contains("the crate `omnilua` failed"), "{fault:?}");
    }
}
