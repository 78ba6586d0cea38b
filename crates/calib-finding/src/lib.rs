//! What a person should know about data or a result: ids, severities, values, and their words.
