"""A console without a program or a browser: its verbs, and requests to its application."""

import pytest
from starlette.testclient import TestClient

from prior_reinforce.arm.console.guard import report_path
from prior_reinforce.arm.console.server import Events, application
from prior_reinforce.arm.console.verbs import Verbs
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

TOKEN = "secret"


@pytest.fixture
def verbs(folder):
    """On a small workspace with a model and no goal."""
    made = Verbs(folder_path(folder), report=report_path(TOKEN))
    yield made
    made.close()


@pytest.fixture
def client(folder):
    """Requests with the secret, to the same."""
    events = Events()
    verbs = Verbs(folder_path(folder), report=report_path(TOKEN), publish=events.publish)
    app = application(verbs, events, TOKEN, "127.0.0.1", VisionLanguageModelConfig())
    headers = {"authorization": f"Bearer {TOKEN}"}
    with TestClient(app, base_url="http://127.0.0.1:8750", headers=headers) as client:
        client.verbs = verbs
        yield client


def folder_path(folder):
    from pathlib import Path

    return Path(folder).resolve()
