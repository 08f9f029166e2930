"""From captures, a project and a question to an answer: verbs and notebooks ask the same."""
