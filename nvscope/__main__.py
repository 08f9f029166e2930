"""``python -m nvscope``: the program."""

from nvscope.cli.main import main

if __name__ == "__main__":
    main()
