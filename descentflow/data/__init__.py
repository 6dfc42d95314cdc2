"""The DataModule that splits by flight, fits the representation on the train part and serves weights."""
