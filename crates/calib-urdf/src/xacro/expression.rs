//! The expressions of xacro that a number can be replaced through: a look-up, or a constant.
//!
//! ```text
//! look-up   name | xacro.load_yaml(file), then any of ['key'] ["key"] .key
//! constant  numbers, pi, + − · / and parentheses, radians(…)
//! ```
//!
//! Everything else is Python, and is not touched.

/// Where a look-up begins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Root {
    /// A property.
    Name(String),
    /// `xacro.load_yaml(argument)`.
    Load(String),
}

/// A look-up: `calibration['elbow']['x']`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Access {
    pub(crate) root: Root,
    pub(crate) keys: Vec<String>,
}

impl Access {
    /// `None` where the expression is more than a look-up.
    pub(crate) fn parse(expression: &str) -> Option<Self> {
        let expression = expression.trim();
        let load = expression
            .strip_prefix("xacro.")
            .unwrap_or(expression)
            .trim_start();
        if let Some(rest) = load
            .strip_prefix("load_yaml")
            .map(str::trim_start)
            .and_then(|rest| rest.strip_prefix('('))
        {
            let close = closing(rest, ')')?;
            return Some(Self {
                root: Root::Load(rest[..close].trim().to_owned()),
                keys: keys(&rest[close + 1..])?,
            });
        }
        let end = expression
            .find(|c: char| !is_name(c))
            .unwrap_or(expression.len());
        let name = &expression[..end];
        if name.is_empty() || name.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        Some(Self {
            root: Root::Name(name.to_owned()),
            keys: keys(&expression[end..])?,
        })
    }
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The byte of the closing sign, quotes skipped, brackets counted.
fn closing(text: &str, close: char) -> Option<usize> {
    let mut quote = None;
    let mut depth = 0_usize;
    for (i, c) in text.char_indices() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (Some(_), _) => {}
            (None, '\'' | '"') => quote = Some(c),
            (None, c) if c == close && depth == 0 => return Some(i),
            (None, '(' | '[') => depth += 1,
            (None, ')' | ']') => depth = depth.checked_sub(1)?,
            _ => {}
        }
    }
    None
}

fn keys(mut rest: &str) -> Option<Vec<String>> {
    let mut keys = Vec::new();
    loop {
        rest = rest.trim();
        if rest.is_empty() {
            return Some(keys);
        }
        if let Some(after) = rest.strip_prefix('.') {
            let end = after.find(|c: char| !is_name(c)).unwrap_or(after.len());
            if end == 0 {
                return None;
            }
            keys.push(after[..end].to_owned());
            rest = &after[end..];
            continue;
        }
        let after = rest.strip_prefix('[')?;
        let close = closing(after, ']')?;
        let key = after[..close].trim();
        let inner = ['\'', '"'].into_iter().find_map(|q| {
            key.strip_prefix(q)
                .and_then(|k| k.strip_suffix(q))
                .filter(|k| !k.contains(q))
        });
        keys.push(inner?.to_owned());
        rest = &after[close + 1..];
    }
}

/// Every look-up inside an expression that computes: `c.x * 2 + f(h)` reads `c.x`, `f` and `h`.
pub(crate) fn look_ups(expression: &str) -> Vec<Access> {
    let mut found = Vec::new();
    let mut rest = expression;
    while let Some(c) = rest.chars().next() {
        if matches!(c, '\'' | '"') {
            let close = rest[1..].find(c).map_or(rest.len(), |i| i + 2);
            rest = &rest[close..];
        } else if is_name(c) {
            let mut end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
            // As many keys as there are; an index that is computed ends it, and the whole is read.
            while let Some(longer) = one_key(&rest[end..]) {
                end += longer;
            }
            found.extend(Access::parse(&rest[..end]));
            rest = &rest[end..];
        } else {
            rest = &rest[c.len_utf8()..];
        }
    }
    found
}

/// Bytes of `.key` or `['key']` at the beginning of a text.
fn one_key(text: &str) -> Option<usize> {
    let length = if let Some(after) = text.strip_prefix('.') {
        1 + after.find(|c: char| !is_name(c)).unwrap_or(after.len())
    } else {
        2 + closing(text.strip_prefix('[')?, ']')?
    };
    keys(&text[..length]).map(|_| length)
}

/// The expressions `${…}` of an attribute's value.
pub(crate) fn expressions(value: &str) -> impl Iterator<Item = &str> {
    value
        .split("${")
        .skip(1)
        .map(|rest| rest.split('}').next().unwrap_or(""))
}

/// The inside of a text that is one expression and nothing else.
pub(crate) fn whole(value: &str) -> Option<&str> {
    let inside = value.trim().strip_prefix("${")?.strip_suffix('}')?;
    (!inside.contains(['{', '}'])).then_some(inside)
}

/// The words of a value with their byte offsets; an expression is one word, also with spaces in it.
pub(crate) fn words(value: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut start = None;
    let mut depth = 0_usize;
    for (i, c) in value.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let space = depth == 0 && matches!(c, ' ' | '\t' | '\n' | '\r');
        match (space, start) {
            (true, Some(begin)) => {
                found.push((begin, &value[begin..i]));
                start = None;
            }
            (false, None) => start = Some(i),
            _ => {}
        }
    }
    if let Some(begin) = start {
        found.push((begin, &value[begin..]));
    }
    found
}

/// The value of a constant expression; `None` for anything that a property or Python could change.
pub(crate) fn constant(expression: &str) -> Option<f64> {
    let mut parser = Constant { rest: expression };
    let value = parser.sum(0)?;
    (parser.rest.trim().is_empty() && value.is_finite()).then_some(value)
}

struct Constant<'a> {
    rest: &'a str,
}

impl Constant<'_> {
    /// No constant of a robot needs more nested parentheses.
    const DEEPEST: usize = 32;

    fn take(&mut self, sign: char) -> bool {
        match self.rest.trim_start().strip_prefix(sign) {
            // `**` is a power and `//` a floor.
            Some(after) if !(matches!(sign, '*' | '/') && after.starts_with(sign)) => {
                self.rest = after;
                true
            }
            _ => false,
        }
    }

    fn sum(&mut self, depth: usize) -> Option<f64> {
        let mut value = self.product(depth)?;
        loop {
            if self.take('+') {
                value += self.product(depth)?;
            } else if self.take('-') {
                value -= self.product(depth)?;
            } else {
                return Some(value);
            }
        }
    }

    fn product(&mut self, depth: usize) -> Option<f64> {
        let mut value = self.factor(depth)?;
        loop {
            if self.take('*') {
                value *= self.factor(depth)?;
            } else if self.take('/') {
                value /= self.factor(depth)?;
            } else {
                return Some(value);
            }
        }
    }

    fn factor(&mut self, depth: usize) -> Option<f64> {
        if depth > Self::DEEPEST {
            return None;
        }
        if self.take('-') {
            return Some(-self.factor(depth + 1)?);
        }
        if self.take('+') {
            return self.factor(depth + 1);
        }
        if self.take('(') {
            let value = self.sum(depth + 1)?;
            return self.take(')').then_some(value);
        }
        self.rest = self.rest.trim_start();
        let end = self
            .rest
            .find(|c: char| !(is_name(c) || c == '.'))
            .unwrap_or(self.rest.len());
        let mut word = &self.rest[..end];
        let after = &self.rest[end..];
        // 1e-3: the sign belongs to the number.
        let exponent = word.starts_with(|c: char| c.is_ascii_digit() || c == '.')
            && word.ends_with(['e', 'E'])
            && after.starts_with(['-', '+']);
        if exponent {
            let digits = after[1..]
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(after.len() - 1);
            word = &self.rest[..end + 1 + digits];
        }
        self.rest = &self.rest[word.len()..];
        match word {
            "pi" | "math.pi" => Some(std::f64::consts::PI),
            "radians" | "math.radians" if self.take('(') => {
                let value = self.sum(depth + 1)?;
                self.take(')').then_some(value.to_radians())
            }
            word if word.starts_with(|c: char| c.is_ascii_digit() || c == '.') => {
                word.parse().ok().filter(|x: &f64| x.is_finite())
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_up() {
        let name = |root: &str, keys: &[&str]| {
            Some(Access {
                root: Root::Name(root.to_owned()),
                keys: keys.iter().map(|k| (*k).to_owned()).collect(),
            })
        };
        assert_eq!(Access::parse(" h "), name("h", &[]));
        assert_eq!(
            Access::parse("c['elbow'][\"x\"]"),
            name("c", &["elbow", "x"])
        );
        assert_eq!(Access::parse("c.elbow . x"), None);
        assert_eq!(Access::parse("c.elbow.x"), name("c", &["elbow", "x"]));
        assert_eq!(
            Access::parse("xacro.load_yaml('$(find a)/c.yaml')['a']"),
            Some(Access {
                root: Root::Load("'$(find a)/c.yaml'".to_owned()),
                keys: vec!["a".to_owned()]
            })
        );
        for computed in [
            "h * 2",
            "-h",
            "2",
            "c[i]",
            "c['a",
            "c[0]",
            "f(x)",
            "",
            "a b",
            "c.",
            "c['a' + 'b']",
        ] {
            assert_eq!(Access::parse(computed), None, "{computed}");
        }
    }

    #[test]
    fn look_ups_of_what_computes() {
        let shown = |text: &str| -> Vec<String> {
            look_ups(text)
                .into_iter()
                .map(|a| match a.root {
                    Root::Name(name) | Root::Load(name) => {
                        format!("{name}:{}", a.keys.join("."))
                    }
                })
                .collect()
        };
        assert_eq!(
            shown("c.a['b'] * 2 + f(h) - 'c' + c[i].x"),
            ["c:a.b", "f:", "h:", "c:", "i:", "x:"]
        );
        assert_eq!(shown("'unclosed c"), Vec::<String>::new());
        assert_eq!(shown("-1e-3 + é"), ["é:"]);
    }

    #[test]
    fn constants() {
        let pi = std::f64::consts::PI;
        for (text, value) in [
            ("pi/2", pi / 2.0),
            ("-pi / 2", -pi / 2.0),
            ("2*(1 - 0.5)+1e-3", 1.001),
            ("radians(90)", pi / 2.0),
            ("--1", 1.0),
            ("-.5", -0.5),
        ] {
            assert_eq!(constant(text), Some(value), "{text}");
        }
        for text in [
            "h", "pi*h", "2**3", "5//2", "1/0", "(1", "1)", "", "1 2", "1e", "0x10", "1_0",
        ] {
            assert_eq!(constant(text), None, "{text}");
        }
        assert_eq!(constant(&"(".repeat(100_000)), None);
        assert_eq!(constant(&"-".repeat(100_000)), None);
    }

    #[test]
    fn words_of_a_value() {
        assert_eq!(
            words(" 0 ${a ['x']}\t1"),
            [(1, "0"), (3, "${a ['x']}"), (14, "1")]
        );
        assert_eq!(whole("${a}"), Some("a"));
        assert_eq!(whole("${a} ${b}"), None);
    }
}
