"""Rules in test programs: assertions on captures, for pytest and Robot Framework."""
