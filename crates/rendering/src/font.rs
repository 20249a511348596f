//! A stroke font of our own, so that images need no fonts from the system: plain capitals and
//! lower-case letters drawn as a plotter would.
//!
//! A glyph is a list of strokes; a stroke is a list of two-digit points, column then row. Row 2 is
//! the base line, row 6 the height of small letters, row 8 that of capitals.

/// Height of capitals in grid units.
pub(crate) const CAP_HEIGHT: f64 = 6.0;
const BASE_ROW: f64 = 2.0;
const GAP: f64 = 1.6;

/// The strokes of a line of text: points relative to their glyph's left end on the base line, and
/// the glyph's column. Control characters are skipped, characters without a glyph become a box.
pub(crate) fn strokes(text: &str) -> Vec<(Vec<(f64, f64)>, f64)> {
    let mut column = 0.0;
    let mut all = Vec::new();
    for c in text.chars().filter(|c| !c.is_control()) {
        let (advance, drawing) = glyph(c);
        for stroke in drawing.split_ascii_whitespace() {
            let points = stroke.as_bytes().chunks_exact(2);
            let digit = |b: u8| f64::from(b.saturating_sub(b'0'));
            all.push((points.map(|p| (digit(p[0]), digit(p[1]) - BASE_ROW)).collect(), column));
        }
        column += f64::from(advance) + GAP;
    }
    all
}

/// Width of a line of text whose capitals are `size` high.
pub(crate) fn width(text: &str, size: f64) -> f64 {
    let units: f64 =
        text.chars().filter(|c| !c.is_control()).map(|c| f64::from(glyph(c).0) + GAP).sum();
    (units - GAP).max(0.0) * size / CAP_HEIGHT
}

/// Width in grid units and strokes.
fn glyph(c: char) -> (u8, &'static str) {
    match c {
        'A'..='Z' => capital(c),
        'a'..='z' => small(c),
        '0'..='9' => digit(c),
        _ => symbol(c),
    }
}

#[rustfmt::skip]
fn capital(c: char) -> (u8, &'static str) {
    match c {
        'A' => (4, "022842 1535"),
        'B' => (4, "02083847463505 3544433202"),
        'C' => (4, "4738180703123243"),
        'D' => (4, "02082847432202"),
        'E' => (4, "48080242 0535"),
        'F' => (4, "480802 0535"),
        'G' => (4, "47381807031232434525"),
        'H' => (4, "0208 4248 0545"),
        'I' => (0, "0208"),
        'J' => (3, "3833221203"),
        'K' => (4, "0208 4804 1542"),
        'L' => (4, "080242"),
        'M' => (4, "0208244842"),
        'N' => (4, "02084248"),
        'O' => (4, "183847433212030718"),
        'P' => (4, "02083847453404"),
        'Q' => (4, "183847433212030718 2442"),
        'R' => (4, "02083847453404 2442"),
        'S' => (4, "473818070615354443321203"),
        'T' => (4, "0848 2822"),
        'U' => (4, "080312324348"),
        'V' => (4, "082248"),
        'W' => (6, "0812365268"),
        'X' => (4, "0248 0842"),
        'Y' => (4, "082548 2522"),
        _ => (4, "08480242"),
    }
}

#[rustfmt::skip]
fn small(c: char) -> (u8, &'static str) {
    match c {
        'a' => (3, "3632 3526160503122233"),
        'b' => (3, "0802 0516263533221203"),
        'c' => (3, "3526160503122233"),
        'd' => (3, "3832 3526160503122233"),
        'e' => (3, "04343526160503122233"),
        'f' => (2, "281712 0626"),
        'g' => (3, "3631201001 3526160503122233"),
        'h' => (3, "0802 0516263532"),
        'i' => (0, "0602 08"),
        'j' => (1, "161100 18"),
        'k' => (3, "0802 3604 1532"),
        'l' => (1, "080312"),
        'm' => (4, "0602 05162522 25364542"),
        'n' => (3, "0602 0516263532"),
        'o' => (3, "162635332212030516"),
        'p' => (3, "0600 0516263533221203"),
        'q' => (3, "3630 3526160503122233"),
        'r' => (2, "0602 051626"),
        's' => (3, "35261605142433221203"),
        't' => (2, "181322 0626"),
        'u' => (3, "0603122233 3632"),
        'v' => (4, "062246"),
        'w' => (4, "0612253246"),
        'x' => (3, "0632 0236"),
        'y' => (4, "0622 4610"),
        _ => (3, "06360232"),
    }
}

#[rustfmt::skip]
fn digit(c: char) -> (u8, &'static str) {
    match c {
        '0' => (3, "182837332212030718"),
        '1' => (2, "071812 0222"),
        '2' => (4, "07183847460242"),
        '3' => (4, "0718384746354443321203 1535"),
        '4' => (4, "32380444"),
        '5' => (4, "480805354443321203"),
        '6' => (4, "473818070312324344351504"),
        '7' => (4, "084812"),
        '8' => (4, "15060718384746351504031232434435"),
        _ => (4, "031232434738180706153546"),
    }
}

#[rustfmt::skip]
fn symbol(c: char) -> (u8, &'static str) {
    match c {
        ' ' => (2, ""),
        '.' => (0, "02"),
        ',' => (1, "1201"),
        ':' => (0, "02 05"),
        ';' => (1, "15 1201"),
        '-' => (2, "0525"),
        '_' => (4, "0141"),
        '+' => (4, "0545 2327"),
        '=' => (4, "0444 0646"),
        '/' => (3, "0238"),
        '\\' => (3, "0832"),
        '(' => (1, "18070312"),
        ')' => (1, "08171302"),
        '[' => (1, "18080212"),
        ']' => (1, "08181202"),
        '<' => (3, "370533"),
        '>' => (3, "073503"),
        '%' => (4, "0248 07 43"),
        '#' => (4, "1218 3238 0444 0646"),
        '*' => (4, "2327 0446 0644"),
        '\'' => (0, "0807"),
        '"' => (1, "0807 1817"),
        '!' => (0, "0804 02"),
        '?' => (3, "07182837361514 12"),
        '&' => (4, "4206071827260403122244"),
        '|' => (0, "0801"),
        '~' => (4, "0516253445"),
        '\u{b0}' => (2, "0718271607"),
        '\u{d7}' => (3, "0336 0633"),
        '\u{b7}' => (0, "05"),
        '\u{2013}' | '\u{2014}' => (4, "0545"),
        _ => (4, "0208484202"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every printable ASCII character is drawn inside its cell, and no two look alike.
    #[test]
    fn glyphs_fit_and_differ() {
        let mut seen = std::collections::BTreeSet::new();
        let boxed = glyph('\u{fffd}').1;
        for c in '!'..='~' {
            let (advance, drawing) = glyph(c);
            for (stroke, _) in strokes(&c.to_string()) {
                assert!(!stroke.is_empty());
                for (x, y) in stroke {
                    assert!((0.0..=f64::from(advance)).contains(&x), "{c}");
                    assert!((-2.0..=CAP_HEIGHT).contains(&y), "{c}");
                }
            }
            assert!(drawing == boxed || seen.insert(drawing), "{c} looks like another");
        }
        assert!(seen.len() > 85);
    }
}
