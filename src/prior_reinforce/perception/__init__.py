"""P: ways of seeing a trial's error. One file each; all share the interface of `base`."""

from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.perception.camera import Camera, CameraConfig
from prior_reinforce.perception.exact import Exact
from prior_reinforce.perception.eye import Eye
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.scene import SeenObject, TableScene, scene_of

__all__ = [
    "Amplified",
    "Camera",
    "CameraConfig",
    "Exact",
    "Eye",
    "Perception",
    "SeenObject",
    "TableCalibration",
    "TableScene",
    "VisionLanguageModel",
    "VisionLanguageModelConfig",
    "scene_of",
]
