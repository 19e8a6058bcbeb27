use crate::compare::Result;
use crate::compare::table::{Tables, Value};

impl Tables {
    /// All rows as one CSV table: `table`, the union of all columns (a cell is empty if its table lacks the column), `flags`, `source`.
    /// Numbers have full precision.
    ///
    /// # Errors
    /// [`crate::compare::Error::Csv`].
    pub fn to_csv(&self) -> Result<String> {
        let mut keys: Vec<&str> = Vec::new();
        for column in self.tables.iter().flat_map(|t| &t.columns) {
            if !keys.contains(&column.key.as_str()) {
                keys.push(&column.key);
            }
        }
        let mut writer = csv::Writer::from_writer(Vec::new());
        let header = ["table"].into_iter().chain(keys.iter().copied());
        writer.write_record(header.chain(["flags", "source"]))?;
        for table in &self.tables {
            for row in &table.rows {
                let cell = |key: &&str| {
                    let place = table.columns.iter().position(|c| c.key == *key);
                    match place.and_then(|c| row.cells.get(c)) {
                        Some(Value::Text(text)) => text.clone(),
                        Some(Value::Number(value)) => value.to_string(),
                        Some(Value::Missing) | None => String::new(),
                    }
                };
                let flags = row.flags.iter();
                let flags: Vec<_> = flags
                    .map(|f| format!("{}: {}", f.severity.word(), f.why))
                    .collect();
                let mut record = vec![table.title.clone()];
                record.extend(keys.iter().map(cell));
                record.push(flags.join("; "));
                record.push(row.source.clone().unwrap_or_default());
                writer.write_record(&record)?;
            }
        }
        let bytes = writer
            .into_inner()
            .map_err(|e| csv::Error::from(e.into_error()))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}
