"""What was found in words: results and their schema, sentences, pages, pictures."""
