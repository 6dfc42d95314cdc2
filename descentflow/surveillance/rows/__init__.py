"""What a surveillance row is: its schema, units and names, and the account of rows dropped."""
