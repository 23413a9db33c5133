# demo and test need Python 3.11 or later, make and a network; everything goes into .venv.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
OPENCV ?=

PAGE := $(wildcard page/*.* page/public/* page/src/*.* page/src/*/*)

.PHONY: demo serve test check coverage bench docs pictures clean

# installing builds the page and fetches the networks too, where their sources have changed
$(BIN)/subtense: pyproject.toml constraints.txt hatch_build.py networks/package-lock.json $(PAGE)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	@touch $@

$(BIN)/pytest: $(BIN)/subtense requirements-dev.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --requirement requirements-dev.txt
	@touch $@

demo: $(BIN)/subtense            ## measure the example photos, print what was found, write the annotated pictures
	$(BIN)/python tools/demo.py

serve: $(BIN)/subtense           ## the page, in the browser
	$(BIN)/subtense serve

test: $(BIN)/pytest              ## the tests
	$(BIN)/pytest --numprocesses 2 --dist worksteal

check: $(BIN)/pytest             ## formatting, lint and types
	$(BIN)/ruff format --check src tests tools benchmarks hatch_build.py
	$(BIN)/ruff check src tests tools benchmarks hatch_build.py
	$(BIN)/mypy
	$(BIN)/python tools/page.py check

coverage: $(BIN)/pytest          ## the long coverage tables, into docs/accuracy.md
	$(BIN)/python benchmarks/accuracy.py

bench: $(BIN)/pytest             ## speed against named peers, into docs/benchmarks.md
	$(BIN)/python benchmarks/run.py

docs: $(BIN)/subtense            ## the documentation site, into site/
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --requirement requirements-docs.txt
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

pictures: $(BIN)/pytest          ## the pictures of the page in the documentation, by its tests
	SUBTENSE_PICTURES=docs/pictures $(BIN)/pytest tests/web/test_pages.py -k pictures

clean:
	rm -rf page/node_modules src/subtense/web/static src/subtense/networks/files $(VENV) site demo-out .pytest_cache .mypy_cache .ruff_cache .hypothesis
