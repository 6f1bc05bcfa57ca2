//! Tokens of a shader file, after directives and macros are resolved.

use super::{Fault, Stage};
use crate::guard;
use pp_rs::pp::Preprocessor;
use pp_rs::token::{PreprocessorError, Punct, Token as Lexed, TokenValue};

/// Greatest number of tokens of a file, after its macros are expanded.
const MAX_TOKENS: usize = 100_000;
/// Deepest nesting of brackets. It is limited because the compiler is recursive.
const MAX_DEPTH: usize = 64;
/// Greatest number of tokens between two semicolons or braces. It is limited because the compiler is recursive.
const MAX_STATEMENT: usize = 2_000;
/// Greatest number of `else` in a file. It is limited because the compiler recurses along chains of `else if`.
const MAX_ELSE: usize = 1_000;
/// Longest line of a directive, bytes. It is limited because the preprocessor is recursive.
const MAX_DIRECTIVE: usize = 1_000;

/// Extensions whose features are available without them.
const HARMLESS: [&str; 6] = [
    "GL_ARB_explicit_attrib_location",
    "GL_ARB_explicit_uniform_location",
    "GL_ARB_separate_shader_objects",
    "GL_ARB_shading_language_420pack",
    "GL_ARB_uniform_buffer_object",
    "GL_ARB_texture_rectangle",
];

/// What a token is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Word,
    Number,
    Sign,
}

/// A token with its place in the file. A token from a macro has the place where the macro is used.
#[derive(Debug, Clone)]
pub(super) struct Token {
    pub kind: Kind,
    pub text: String,
    pub start: usize,
    pub end: usize,
}

impl Token {
    pub fn is(&self, sign: &str) -> bool {
        self.kind == Kind::Sign && self.text == sign
    }

    pub fn is_word(&self, word: &str) -> bool {
        self.kind == Kind::Word && self.text == word
    }

    pub fn fault(&self, stage: Stage, message: impl Into<String>, help: &str) -> Fault {
        let help = Some(help).filter(|help| !help.is_empty()).map(str::to_owned);
        Fault { stage, start: self.start, end: self.end, message: message.into(), help }
    }
}

/// The tokens of a file.
pub(super) fn tokens(stage: Stage, text: &str) -> Result<Vec<Token>, Fault> {
    let fault = |start: usize, message: String, help: &str| {
        let help = Some(help).filter(|help| !help.is_empty()).map(str::to_owned);
        Fault { stage, start, end: start, message, help }
    };
    let bare = without_comments(text).map_err(|start| fault(start, "this comment never ends".to_owned(), ""))?;
    check_directives(&bare).map_err(|(start, message, help)| fault(start, message, help))?;
    let lexed = guard::call("pp-rs", || Preprocessor::new(&bare).take(MAX_TOKENS + 1).collect::<Vec<_>>());
    let lexed = lexed.map_err(|message| fault(0, message, ""))?;
    if lexed.len() > MAX_TOKENS {
        return Err(fault(0, format!("the file has more than {MAX_TOKENS} tokens"), ""));
    }
    let mut tokens = Vec::with_capacity(lexed.len());
    for item in lexed {
        let Lexed { value, location } = item.map_err(|(error, location)| {
            let (start, end) = (location.start as usize, location.end as usize);
            Fault { stage, start, end, message: describe(&error), help: None }
        })?;
        let (start, end) = (location.start as usize, (location.end as usize).min(text.len()));
        let (kind, text) = match value {
            TokenValue::Ident(name) => (Kind::Word, name),
            TokenValue::Integer(integer) => {
                (Kind::Number, format!("{}{}", integer.value, if integer.signed { "" } else { "u" }))
            }
            TokenValue::Float(float) if float.value.is_finite() => (Kind::Number, format!("{:?}", float.value)),
            TokenValue::Float(_) => return Err(fault(start, "this number is not finite in 32 bits".to_owned(), "")),
            TokenValue::Punct(punct) => (Kind::Sign, sign(&punct).to_owned()),
            TokenValue::Version(version) => {
                check_version(&version.tokens).map_err(|message| {
                    fault(start, message, "valid: #version 110 to 460, of OpenGL and not of OpenGL ES")
                })?;
                continue;
            }
            TokenValue::Extension(extension) => {
                check_extension(&extension.tokens).map_err(|message| fault(start, message, ""))?;
                continue;
            }
            TokenValue::Pragma(_) => continue,
        };
        tokens.push(Token { kind, text, start, end });
    }
    check_nesting(stage, &tokens)?;
    Ok(tokens)
}

/// The source with comments replaced by blanks; every other byte stays in its place. The error is the first byte of a comment that does not
/// end.
fn without_comments(text: &str) -> Result<String, usize> {
    let bytes = text.as_bytes();
    let mut bare = bytes.to_vec();
    let mut at = 0;
    while at < bytes.len() {
        let end = match bytes.get(at..at + 2) {
            Some(b"//") => bytes[at..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |line| at + line),
            Some(b"/*") => at + 4 + text.get(at + 2..).and_then(|rest| rest.find("*/")).ok_or(at)?,
            _ => {
                at += 1;
                continue;
            }
        };
        for byte in &mut bare[at..end] {
            if !matches!(byte, b'\n' | b'\r') {
                *byte = b' ';
            }
        }
        at = end;
    }
    // Comments begin and end between characters, so what is left is valid UTF-8.
    Ok(String::from_utf8(bare).unwrap_or_default())
}

/// Refuses directives with which the preprocessor would run for long or recurse deeply.
fn check_directives(bare: &str) -> Result<(), (usize, String, &'static str)> {
    if let Some(at) = bare.find('\\') {
        return Err((at, "a `\\` outside comments".to_owned(), "write the line that it continues as one"));
    }
    let mut at = 0;
    for line in bare.split_inclusive('\n') {
        let start = at + (line.len() - line.trim_start().len());
        at += line.len();
        let Some(directive) = line.trim_start().strip_prefix('#') else { continue };
        if directive.len() > MAX_DIRECTIVE {
            return Err((start, format!("this directive is longer than {MAX_DIRECTIVE} bytes"), ""));
        }
        let directive = directive.trim();
        if directive.starts_with("include") {
            return Err((start, "#include is not GLSL of the engine".to_owned(), "put the text of that file here"));
        }
        let Some(define) = directive.strip_prefix("define") else { continue };
        let name = define.trim_start();
        let end = name.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(name.len());
        if name[end..].starts_with('(') {
            let message = format!("the macro `{}` has parameters, which is not supported", &name[..end]);
            return Err((start, message, "write a function instead"));
        }
    }
    Ok(())
}

fn check_version(tokens: &[Lexed]) -> Result<(), String> {
    let number = tokens.iter().find_map(|token| match &token.value {
        TokenValue::Integer(integer) => Some(integer.value),
        _ => None,
    });
    let es = tokens.iter().any(|token| matches!(&token.value, TokenValue::Ident(name) if name == "es"));
    match number {
        Some(110..=460) if !es => Ok(()),
        Some(number) => Err(format!("version {number}{} is not supported", if es { " es" } else { "" })),
        None => Err("this #version has no number".to_owned()),
    }
}

fn check_extension(tokens: &[Lexed]) -> Result<(), String> {
    let mut words = tokens.iter().filter_map(|token| match &token.value {
        TokenValue::Ident(word) => Some(word.as_str()),
        _ => None,
    });
    let (name, behaviour) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    // In OpenGL a missing extension is an error only with `require`.
    if behaviour != "require" || HARMLESS.contains(&name) {
        return Ok(());
    }
    Err(format!("the extension `{name}` is not supported"))
}

fn check_nesting(stage: Stage, tokens: &[Token]) -> Result<(), Fault> {
    let (mut depth, mut length, mut others) = (0_usize, 0_usize, 0_usize);
    for token in tokens {
        length += 1;
        if token.kind == Kind::Sign {
            match token.text.as_str() {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => {
                    depth = depth.checked_sub(1).ok_or_else(|| {
                        token.fault(stage, format!("nothing was opened that this `{}` closes", token.text), "")
                    })?;
                }
                _ => {}
            }
            if matches!(token.text.as_str(), ";" | "{" | "}") {
                length = 0;
            }
        } else if token.is_word("else") {
            others += 1;
        }
        if others > MAX_ELSE {
            return Err(token.fault(stage, format!("more than {MAX_ELSE} `else`"), ""));
        }
        if depth > MAX_DEPTH {
            return Err(token.fault(stage, format!("brackets are nested deeper than {MAX_DEPTH}"), ""));
        }
        if length > MAX_STATEMENT {
            return Err(token.fault(stage, format!("a statement of more than {MAX_STATEMENT} tokens"), ""));
        }
    }
    match tokens.last() {
        Some(last) if depth > 0 => Err(last.fault(stage, "the file ends inside brackets", "")),
        _ => Ok(()),
    }
}

fn describe(error: &PreprocessorError) -> String {
    use PreprocessorError as E;
    match error {
        E::UnknownDirective => "this directive is not known".to_owned(),
        E::ErrorDirective => "the file stops here itself, by #error".to_owned(),
        E::UnexpectedCharacter => "this character means nothing in GLSL".to_owned(),
        E::UnfinishedBlock => "an #if without its #endif".to_owned(),
        E::NotSupported16BitLiteral | E::NotSupported64BitLiteral => "numbers have 32 bits here".to_owned(),
        E::UnexpectedHash => "a `#` inside a line".to_owned(),
        E::IntegerOverflow => "this number does not fit into 32 bits".to_owned(),
        E::MacroNotDefined => "this macro was never defined".to_owned(),
        other => format!("the preprocessor cannot read this: {other:?}"),
    }
}

fn sign(punct: &Punct) -> &'static str {
    match punct {
        Punct::AddAssign => "+=",
        Punct::SubAssign => "-=",
        Punct::MulAssign => "*=",
        Punct::DivAssign => "/=",
        Punct::ModAssign => "%=",
        Punct::LeftShiftAssign => "<<=",
        Punct::RightShiftAssign => ">>=",
        Punct::AndAssign => "&=",
        Punct::XorAssign => "^=",
        Punct::OrAssign => "|=",
        Punct::Increment => "++",
        Punct::Decrement => "--",
        Punct::LogicalAnd => "&&",
        Punct::LogicalOr => "||",
        Punct::LogicalXor => "^^",
        Punct::LessEqual => "<=",
        Punct::GreaterEqual => ">=",
        Punct::EqualEqual => "==",
        Punct::NotEqual => "!=",
        Punct::LeftShift => "<<",
        Punct::RightShift => ">>",
        Punct::LeftBrace => "{",
        Punct::RightBrace => "}",
        Punct::LeftParen => "(",
        Punct::RightParen => ")",
        Punct::LeftBracket => "[",
        Punct::RightBracket => "]",
        Punct::LeftAngle => "<",
        Punct::RightAngle => ">",
        Punct::Semicolon => ";",
        Punct::Comma => ",",
        Punct::Colon => ":",
        Punct::Dot => ".",
        Punct::Equal => "=",
        Punct::Bang => "!",
        Punct::Minus => "-",
        Punct::Tilde => "~",
        Punct::Plus => "+",
        Punct::Star => "*",
        Punct::Slash => "/",
        Punct::Percent => "%",
        Punct::Pipe => "|",
        Punct::Caret => "^",
        Punct::Ampersand => "&",
        Punct::Question => "?",
    }
}
