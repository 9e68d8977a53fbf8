//! Measured records: thermal records and captures (`contracts/record.md`).
