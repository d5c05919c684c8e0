//! Tables of text without lines, and paragraphs, for a terminal.

pub use comfy_table::CellAlignment::{Left, Right};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Row, Table};
use console::{Term, measure_text_width};
use textwrap::{Options, WordSeparator, WordSplitter, wrap};

/// Widest text: longer lines are hard to read, even where the terminal has room.
pub const MAX_WIDTH: usize = 100;
/// Narrowest text: below, every word would be a line.
const MIN_WIDTH: usize = 60;
/// Width of text that goes to no terminal.
pub const DEFAULT_WIDTH: usize = 80;

/// Width of a text for standard output, in columns.
pub fn stdout_width() -> usize {
    let width = Term::stdout().size_checked().map_or(DEFAULT_WIDTH, |(_, width)| usize::from(width));
    width.clamp(MIN_WIDTH, MAX_WIDTH)
}

/// A header and rows of cells as lines of text, each column aligned to one side, with `gap` blanks between columns.
pub fn text_table<R: Into<Row>>(
    gap: u16,
    header: &[(&str, CellAlignment)],
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header.iter().map(|(name, _)| name)).add_rows(rows);
    for (k, (column, (_, alignment))) in table.column_iter_mut().zip(header).enumerate() {
        column.set_padding((if k == 0 { 0 } else { gap }, 0)).set_cell_alignment(*alignment);
    }
    table.trim_fmt() + "\n"
}

/// Words behind a head, on as many lines of at most `width` columns as they need, indented like the first word.
///
/// The head may hold the codes of a terminal's colours, which take no room.
pub fn paragraph(head: &str, words: &str, width: usize) -> String {
    let indent = " ".repeat(measure_text_width(head));
    let options = Options::new(width)
        .subsequent_indent(&indent)
        .initial_indent(&indent)
        .break_words(false)
        .word_separator(WordSeparator::AsciiSpace)
        .word_splitter(WordSplitter::NoHyphenation);
    let lines = wrap(words, options).join("\n");
    format!("{head}{}\n", lines.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [["one", "1.5"], ["thirteen", "13"]].map(|row| row.map(String::from));
        let text = text_table(2, &[("leg", Left), ("length", Right)], rows);
        assert_eq!(text, "leg       length\none          1.5\nthirteen      13\n");
    }

    #[test]
    fn a_paragraph_is_indented_and_breaks_no_word() {
        assert_eq!(paragraph("a: ", "", 20), "a: \n");
        assert_eq!(paragraph("a: ", "bb cc-cc ddddddddddddd", 8), "a: bb\n   cc-cc\n   ddddddddddddd\n");
        assert_eq!(paragraph("\u{1b}[31ma\u{1b}[0m: ", "bb cc", 6), "\u{1b}[31ma\u{1b}[0m: bb\n   cc\n");
    }
}
