"""``python -m nvscope``: the program."""

from nvscope.cli.start import main

if __name__ == "__main__":
    main()
