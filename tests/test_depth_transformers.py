"""A network of transformers, with weights made up here, by the code that loads the real ones.

It takes PyTorch, which the tests do not install.
"""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from subtense.cli import main

NAME = "depth-anything/Depth-Anything-V2-Metric-Indoor-Small-hf"


@pytest.fixture
def network(tmp_path, monkeypatch):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    made = pytest.importorskip("transformers", reason="transformers is not installed")
    torch.manual_seed(0)
    stages = [f"stage{i}" for i in range(1, 5)]
    backbone = made.Dinov2Config(hidden_size=32, num_hidden_layers=4, num_attention_heads=2, image_size=518, patch_size=14,
                                 out_features=stages, reshape_hidden_states=False, apply_layernorm=True)  # fmt: skip
    config = made.DepthAnythingConfig(backbone_config=backbone, reassemble_hidden_size=32, neck_hidden_sizes=[8, 16, 32, 32],
                                      fusion_hidden_size=16, head_hidden_size=8, patch_size=14, depth_estimation_type="metric",
                                      max_depth=20)  # fmt: skip
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    made.DepthAnythingForDepthEstimation(config).save_pretrained(NAME)
    made.DPTImageProcessor(size={"height": 518, "width": 518}, keep_aspect_ratio=True, ensure_multiple_of=14, do_pad=False,
                           image_mean=[0.485, 0.456, 0.406], image_std=[0.229, 0.224, 0.225], resample=3).save_pretrained(NAME)  # fmt: skip


def test_a_network_on_this_machine_is_run_and_anchored(network, examples):
    words = [
        "depth",
        str(examples / "desk.jpg"),
        "--prefer",
        "depth-anything-v2-metric-indoor-small",
        "--point",
        "800,600",
        "--format",
        "json",
    ]
    told = CliRunner().invoke(main, words)
    assert told.exit_code == 0, told.output
    free = json.loads(told.stdout)
    assert {"unanchored_depth", "focal_corrected"} <= {note["code"] for note in free["notes"]}
    found = CliRunner().invoke(main, [*words, "--anchor", "800,600 = 0.7 ± 0.01 m"])
    m = json.loads(found.stdout)["measurements"][0]
    assert m["low"] < 0.7 < m["high"] and np.isfinite(m["u"])
