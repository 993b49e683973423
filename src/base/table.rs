//! Tables as CSV: rows are plain data with a field for every column.

use serde::Serialize;

/// Writes a table as CSV. A row's fields are in the columns' order; a list in a row fills as many
/// columns as it has items.
///
/// # Panics
/// If a row does not have a field for every column.
pub(crate) fn csv<R: Serialize>(
    columns: impl IntoIterator<Item = impl AsRef<[u8]>>,
    rows: impl IntoIterator<Item = R>,
) -> Vec<u8> {
    const WHY: &str = "rows have a field for every column, and memory can be written to";
    let mut writer = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(Vec::new());
    writer.write_record(columns).expect(WHY);
    rows.into_iter()
        .for_each(|row| writer.serialize(row).expect(WHY));
    writer.into_inner().expect(WHY)
}

/// Returns names of columns numbered from 0, such as `displacement_0`.
pub(crate) fn numbered(name: &str, count: usize) -> impl Iterator<Item = String> {
    (0..count).map(move |number| format!("{name}_{number}"))
}

pub(crate) fn padded(values: &[f64], columns: usize) -> Vec<Option<f64>> {
    (0..columns)
        .map(|column| values.get(column).copied())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_names_numbers_and_lists_is_a_line_that_other_programs_read() {
        let columns = ["id", "none"]
            .map(str::to_string)
            .into_iter()
            .chain(numbered("walk", 2));
        let rows = [
            ("a,b", None::<u8>, padded(&[1.5], 2)),
            ("c", Some(7), padded(&[0.1 + 0.2, -0.0], 2)),
        ];
        let text = String::from_utf8(csv(columns, rows)).unwrap();
        assert_eq!(
            text,
            "id,none,walk_0,walk_1\n\"a,b\",,1.5,\nc,7,0.30000000000000004,-0.0\n"
        );
    }
}
