"""P = a vision-language model that finds the two objects in the bird's-eye picture.

Source: paper, Section V-A, Perception Process: bounding boxes of the relevant objects in the key
frame, pixel differences between their centres turned into a feedback vector. One request an object,
several answers a request, the median of those that agree, and the operator instead of a guess are
ours, because models return no labels with their boxes, refuse, ramble and now and then see things.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point
from prior_reinforce.environment import KeyFrame, Picture, Rollout, SeenObject, TableScene
from prior_reinforce.errors import ConfigurationError, EndpointError, PerceptionFailedError
from prior_reinforce.perception import vlm_formats
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.perception.vlm_client import (
    ModelClient,
    OpenAIClient,
    VisionLanguageModelConfig,
)
from prior_reinforce.perception.vlm_formats import FORMATS, Box, UnreadableAnswerError
from prior_reinforce.perception.vlm_reading import Answer, OffBy, PictureReading, Sighting
from prior_reinforce.readings import Reading

if TYPE_CHECKING:
    from prior_reinforce.perception.camera import Camera

_TOO_SMALL, _TOO_LARGE, _ALIKE = 0.85, 1.2, 1.15
"""How much smaller or larger than they are two objects look where all numbers are of another scale;
up to which ratio that is one scale for both. Ours: answers in whole thousandths are within 5 % of
the true box where nothing hides it."""
_LOOSE = 1.3
"""Up to what factor a box's side fits an object (ours): models draw boxes 20 to 30 % too large or
small."""
_DRAWN = 3
"""By how many of its steps a side may differ from an object's by chance (ours): one at each end,
and a blurred edge."""


class VisionLanguageModel(Perception):
    """Sees the error in a picture, with any OpenAI-compatible endpoint.

    Attributes:
        last_reading: Record of the latest picture, also of one that gave no error; None before.
    """

    config_type: ClassVar[type[VisionLanguageModelConfig]] = VisionLanguageModelConfig

    def __init__(
        self,
        scene: TableScene | None,
        config: VisionLanguageModelConfig | None = None,
        *,
        client: ModelClient | None = None,
        camera: Camera | None = None,
        calibration: TableCalibration | None = None,
    ) -> None:
        """Connect to the endpoint; nothing is sent yet.

        Args:
            scene: What to look for: a task's `scene`.
            config: Where and how to ask.
            client: Who is asked; the endpoint of `config` when not given.
            camera: Takes the pictures of simulated trials.
            calibration: Of the camera. None calibrates it on the scene's marks, in simulation.

        Raises:
            MissingExtraError: The extra [vlm] is not installed.
            ConfigurationError: There is no scene, or the variable that should hold the key is not
                set.
        """
        if scene is None:
            raise ConfigurationError(
                "nothing says what to look for in the picture; give the task a `scene`: a "
                "TableScene with your objects' names"
            )
        self.scene = scene
        self.config = config or VisionLanguageModelConfig()
        self.last_reading: PictureReading | None = None
        self._camera = camera
        self._client = client or OpenAIClient(self.config)
        self._calibration = calibration
        self._scene_model: object = None
        """The model on which we calibrated ourselves; None where the calibration was given."""

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Photograph the key frame, with the goal's object at the goal, and read the picture.

        The randomness is the model's own; `rng` is not used.

        Raises:
            EndpointError: The endpoint does not answer, or refuses.
            PerceptionFailedError: There is no picture, or no error can be read from it.
            ConfigurationError: The goal is not (x, y).
            RenderingUnavailableError: There is no OpenGL on this machine.
        """
        if np.shape(goal) != (2,):
            raise ConfigurationError(
                f"a goal of shape {np.shape(goal)} cannot be seen from above, which shows (x, y); "
                "use another perception"
            )
        if rollout.key_frame is None:
            raise PerceptionFailedError(
                "this trial left no key frame to draw; pass the camera's picture to `read`, or "
                "ask the operator for the error"
            )
        camera = self._calibrated_in(rollout.key_frame)
        reading = self.read(camera.picture(rollout.key_frame, goal))
        if reading.error_seen is None:
            kind = EndpointError if reading.unanswered else PerceptionFailedError
            raise kind(f"{reading.problem}; ask the operator for the error")
        assert reading.sd is not None
        return Reading.measured(reading.error_seen, reading.sd)

    def read(self, picture: ArrayLike) -> PictureReading:
        """Read the error from any picture of the calibrated camera, a photograph for instance.

        Args:
            picture: RGB, shape (height, width, 3), of type uint8.

        Returns:
            The record; its `error_seen` is None, and `problem` says why, where reading failed.

        Raises:
            ConfigurationError: There is no calibration, or the picture is not RGB in uint8.
        """
        picture = _rgb(picture)
        goal = goal_place = goal_pixel = sd = None
        scale = 1.0
        reached = self.find(self.scene.reached, picture)
        if reached.problem is None:
            goal = self.find(self.scene.goal, picture)
            if problem := self._misread(reached, goal, picture):
                goal = replace(goal, place=None, problem=problem)
            if goal.place is not None:
                goal_place = goal.place + np.array(self.scene.goal_offset)
                x, y = self._in(picture).to_pixels(goal_place).tolist()
                goal_pixel = (x, y)
                scale, scale_sd = self._scale(reached, goal, picture)
                of_boxes = self._in(picture).sd_off(np.hypot(reached.off, goal.off))
                sd = np.maximum(of_boxes, scale_sd * np.abs(reached.place - goal_place))
        self.last_reading = PictureReading(
            picture, self._client.model, reached, goal, goal_place, goal_pixel, scale, sd
        )
        return self.last_reading

    def close(self) -> None:
        """Close the connections and free the camera."""
        self._client.close()
        if self._camera is not None:
            self._camera.close()

    def _calibrated_in(self, key_frame: KeyFrame) -> Camera:
        """The camera, calibrated once a scene on its marks unless a calibration was given."""
        from prior_reinforce.perception.camera import Camera  # photographs need no simulator

        camera = self._camera = self._camera or Camera()
        given = self._calibration is not None and self._scene_model is None
        if not given and self._scene_model is not key_frame.model:
            marks, height = np.array(self.scene.marks), self.scene.plane_height
            self._calibration = camera.calibrate(key_frame.model, marks, height=height)
            self._scene_model = key_frame.model
        return camera

    def _in(self, picture: Picture) -> TableCalibration:
        """The calibration of a picture of this size."""
        if self._calibration is None:
            raise ConfigurationError(
                "the camera is not calibrated; pass calibration=TableCalibration.fit(...)"
            )
        return self._calibration.in_picture((picture.shape[1], picture.shape[0]))

    def _misread(self, reached: Sighting, goal: Sighting, picture: Picture) -> str:
        """Why both objects' boxes are read wrongly, if they are.

        Then both fit with x and y swapped only, both look smaller or larger than they are, or both
        as flat as the picture is.
        """
        if reached.box is None or goal.box is None:
            return ""
        calibration, (tall, wide) = self._in(picture), picture.shape[:2]
        found = [(reached.box, self.scene.reached.size), (goal.box, self.scene.goal.size)]
        (_, one), (_, other) = found
        # Objects of two sizes have two boxes, and two of one size cannot lie in one place.
        if np.allclose(reached.box, goal.box, rtol=0, atol=_DRAWN * _step(picture)):
            return "the model gives one box for both objects"
        read = [_misfit(box, calibration, size) for box, size in found]
        swapped = [_misfit(self._swapped(box, wide / tall), calibration, s) for box, s in found]
        # Swapped thousandths fit by the picture's shape worse, as two loose boxes hardly both do.
        in_pixels = FORMATS[self.config.family].scale == "pixels"
        flat = 1.0 if in_pixels else max(wide / tall, tall / wide)
        by = min(_LOOSE, flat**0.5) if flat > _LOOSE else _LOOSE
        if _fits_better(swapped, read, by=by):
            return f"both boxes fit {self._other_order()}"
        exchanged = [_misfit(reached.box, calibration, other), _misfit(goal.box, calibration, one)]
        if _fits_better(exchanged, read):
            return (
                f"both boxes fit only with {reached.words} and {goal.words} exchanged: does the "
                "model take one for the other, are the sizes right?"
            )
        if not (seen := another_scale(found, calibration, wide / tall)):
            return ""
        unsized = "is the picture as large as that in which the camera was calibrated, "
        return (
            f"both objects look {seen}: {unsized if calibration.picture is None else ''}is the "
            "model family set right, does the server shrink pictures (then set max_image_side), "
            "are the sizes right?"
        )

    def _scale(self, reached: Sighting, goal: Sighting, picture: Picture) -> tuple[float, float]:
        """How many times as large as they are both objects look, and the sd of a distance by that.

        The scale is 1 where it may be chance. The sd is a share of the distance: the true scale
        lies anywhere between what both boxes allow; in a simulated picture it is known to be 1.
        """
        assert reached.box is not None
        assert goal.box is not None
        found = [(reached.box, self.scene.reached.size), (goal.box, self.scene.goal.size)]
        seen = [sides_of(box, self._in(picture), size) for box, size in found]
        chance = np.array([_DRAWN * _step(picture) / ball for _, _, ball in seen])
        # No side of an object is above a ball's, and its longest is not below a flat disc's.
        least = np.array([(sides / ball).max() for sides, _, ball in seen])
        most = np.array([(sides / disc).max() for sides, disc, _ in seen])
        low, high = (least - chance).max(), (most + chance).min()
        scale = 1.0
        if low > high:  # no scale is that of both
            low, high = 1 - chance.min(), 1 + chance.min()
        elif low > 1:
            scale = float(least[np.argmax(least - chance)])
        elif high < 1:
            scale = float(most[np.argmin(most + chance)])
        middle, sd = (low + high) / 2, (high - low) / np.sqrt(12)
        simulated = self._scene_model is not None
        return scale, 0.0 if simulated else float(np.hypot(middle - 1, sd) / middle)

    def _swapped(self, box: Box, wide: float) -> Box:
        """The box of the same numbers with x and y swapped, in a picture so many times as wide."""
        left, top, right, bottom = box
        per = wide if FORMATS[self.config.family].scale == "thousandths" else 1.0
        return top * per, left / per, bottom * per, right / per

    def _other_order(self) -> str:
        """What boxes say that fit with x and y swapped, and the families that are read so."""
        family = FORMATS[self.config.family]
        first, other = ("y", "x") if family.y_first else ("x", "y")
        alike = replace(family, y_first=not family.y_first, prompt="")
        named = [name for name, form in FORMATS.items() if replace(form, prompt="") == alike]
        return (
            f"only with x and y swapped: '{self.config.family}' is read {first} first, but the "
            f"model answers {other} first"
        ) + (f"; set family to {' or '.join(named)}" if named else ", and no family is read so")

    def find(self, wanted: SeenObject, picture: Picture) -> Sighting:
        """Ask for one object, in an RGB picture of the calibrated camera, until enough agree.

        Raises:
            ConfigurationError: There is no calibration.
        """
        calibration, sent = self._in(picture), _shrunk(picture, self.config)
        words, votes = wanted.words, self.config.votes
        answers: list[Answer] = []
        boxes: list[Box] = []
        for _ in range(self.config.most_requests):
            try:
                answer = self._client.ask(words, sent)
            except EndpointError as error:
                problem = f"looking for {words}: {error}"
                return Sighting(words, tuple(answers), problem=problem, unanswered=True)
            answers.append(self._judged(answer, wanted, picture, sent))
            boxes = [answer.box for answer in answers if answer.box is not None]
            absent = sum(answer.absent for answer in answers)
            if len(boxes) + absent >= votes and absent > len(boxes):
                problem = f"{words} is not in the picture, say {absent} of {len(answers)} answers"
                return Sighting(words, tuple(answers), problem=problem)
            box = _agreed(boxes, calibration, self.config.spread_gate)
            if len(boxes) >= votes and box is not None:
                place = calibration.to_table(_centres(np.array([box])))[0]
                off, by = _off(box, calibration, wanted, picture)
                return Sighting(words, tuple(answers), box, place, off=off, off_by=by)
        if len(boxes) >= votes:
            gate_cm = 100 * self.config.spread_gate
            why = f"{len(boxes)} answers do not agree on a place to {gate_cm:g} cm"
        else:
            last = [answer.problem for answer in answers if answer.problem is not None][-1]
            why = f"only {len(boxes)} of {len(answers)} answers hold a box (last: {last})"
        return Sighting(words, tuple(answers), problem=f"{words}: {why}")

    def _judged(
        self, answer: Answer, wanted: SeenObject, picture: Picture, sent: Picture
    ) -> Answer:
        """The answer with its box, in pixels of the picture as taken, or with why there is none.

        One that cannot be around an object of this size is none.
        """
        height, width, _ = sent.shape
        try:
            if answer.finish_reason == "length":
                raise UnreadableAnswerError("cut off at max_tokens")
            if answer.finish_reason == "content_filter":
                raise UnreadableAnswerError("stopped by the server's content filter")
            if not answer.text.strip() and answer.thinking:
                raise UnreadableAnswerError(
                    "the answer is empty, all of it is in the thoughts; serve the model without a "
                    "reasoning parser, or raise max_tokens"
                )
            box = vlm_formats.read_box(
                answer.text, FORMATS[self.config.family], (width, height), wanted.words
            )
            per_x, per_y = picture.shape[1] / width, picture.shape[0] / height
            left, top, right, bottom = np.multiply(box, (per_x, per_y, per_x, per_y)).tolist()
            here = self._in(picture)
            corners = here.to_table([[left, top], [right, top], [left, bottom]])
            side = np.linalg.norm(corners[1:] - corners[0], axis=1).max()
            if not wanted.size / 2 <= side <= 2 * wanted.size:
                says = f"a box of {100 * side:.1f} cm for an object of {100 * wanted.size:.1f} cm"
                read = left, top, right, bottom
                swapped = self._swapped(read, width / height)
                if _fits_better(*([_misfit(b, here, wanted.size)] for b in (swapped, read))):
                    says += f", which fits {self._other_order()}"
                raise UnreadableAnswerError(says)
        except UnreadableAnswerError as error:
            absent = isinstance(error, vlm_formats.NotInPictureError)
            return replace(answer, problem=str(error), absent=absent)
        return replace(answer, box=(left, top, right, bottom))


def _rgb(picture: ArrayLike) -> Picture:
    array = np.asarray(picture)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3:
        raise ConfigurationError(
            f"a picture of shape {array.shape} and type {array.dtype}: expected RGB, (height, "
            "width, 3) and uint8; convert it, or open its file with `read_picture`"
        )
    return array


def _shrunk(picture: Picture, config: VisionLanguageModelConfig) -> Picture:
    """The picture in a size that a server will leave as it is."""
    from PIL import Image

    image = Image.fromarray(picture)
    sent = vlm_formats.size_to_send(*image.size, config.max_image_side, FORMATS[config.family])
    if sent == image.size:
        return picture
    return np.asarray(image.resize(sent, Image.Resampling.LANCZOS))


def another_scale(
    found: list[tuple[Box, float]], calibration: TableCalibration, wide: float, round: bool = True
) -> str:
    """Say how objects look whose boxes are all read in another scale; nothing if they are not.

    Each has a box [px] and a size [m]; the picture is so many times as wide as high. One that is
    not `round` may be as flat as that itself.
    """
    seen = zip(*(sides_of(box, calibration, size) for box, size in found), strict=True)
    sides, discs, balls = map(np.array, seen)
    small, large = (sides / discs).max(axis=1), (sides / balls[:, None]).min(axis=1)
    shapes, of_discs = (each[:, 0] / each[:, 1] for each in (sides, discs))  # a ball's is 1
    flat = shapes / np.clip(shapes, np.minimum(of_discs, 1.0), np.maximum(of_discs, 1.0))
    sizes = small if small.max() < _TOO_SMALL else large
    if _alike(*sizes) and (small.max() < _TOO_SMALL or large.min() > _TOO_LARGE):
        times = " and ".join(f"{times:.2f}" for times in sizes)
        return f"{times} times as large as {'they are' if len(found) > 1 else 'it is'}"
    # One box may be as flat by chance, where the picture is hardly flatter than boxes are loose.
    tells = not _alike(wide, 1.0) if len(found) > 1 else max(wide, 1 / wide) > _LOOSE * _ALIKE
    alike = any(all(_alike(each, shape) for each in flat) for shape in (wide, 1 / wide))
    return "as flat as the picture" if round and tells and alike else ""


def _misfit(box: Box, calibration: TableCalibration, size: float) -> float:
    """How many times a side is above a ball's of this size [m] there, or below a flat disc's."""
    sides, disc, ball = sides_of(box, calibration, size)
    return max((sides / ball).max(), (disc / sides).max())


def sides_of(
    box: Box, calibration: TableCalibration, size: float
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"], float]:
    """Return the sides of a box, of a flat disc's of this size [m] there, and a ball's, in [px]."""
    left, top, right, bottom = box
    middle = np.array([(left + right) / 2, (top + bottom) / 2])
    return np.array([right - left, bottom - top]), *calibration.seen(middle, size)


def _off(
    box: Box, calibration: TableCalibration, wanted: SeenObject, picture: Picture
) -> tuple[Float[np.ndarray, "2"], OffBy | None]:
    """How far an object's middle may be beside its box's, in [m], and by what most.

    That is half of what the sides are off: one at the picture's border lacks what is cut, one that
    is shorter than the other (where the object is round) what is hidden; one that is longer than
    boxes are drawn loosely is around something else, too.
    """
    sides, disc, ball = sides_of(box, calibration, wanted.size)
    ends, border = np.reshape(box, (2, 2)), np.array(picture.shape[1::-1]) - _step(picture)
    cut = (ends[0] <= _step(picture)) | (ends[1] >= border)
    whole = min((sides / disc).max(), 1.0) * disc  # as large as the longer side says
    wrong: dict[OffBy, Float[np.ndarray, "2"]] = {
        "cut": np.where(cut, disc - sides, 0),
        "hidden": np.where(wanted.round, whole - sides, 0),
        "too large": np.where(sides > _LOOSE * ball, sides - ball, 0),
    }
    half = np.max([*wrong.values()], axis=0).clip(0) / 2
    worst: OffBy = max(wrong, key=lambda cause: float(wrong[cause].max()))
    places = calibration.to_table(ends.mean(axis=0) + np.vstack([[0, 0], np.diag(half)]))
    return np.abs(places[1:] - places[0]).sum(axis=0), worst if half.any() else None


def _step(picture: Picture) -> float:
    """What a box is at least rounded to, in [px]: thousandths of the longer side, or pixels."""
    return max(1.0, max(picture.shape) / 1000)


def _fits_better(swapped: list[float], read: list[float], *, by: float = _LOOSE) -> bool:
    """Whether boxes fit swapped or exchanged, each better by more than a factor.

    Both are misfits; the factor is that by which boxes are drawn loosely, if nothing more is known.
    """
    better = all(s * by < r for s, r in zip(swapped, read, strict=True))
    return max(swapped) <= _LOOSE and better


def _alike(*ratios: float) -> bool:
    return max(ratios) / min(ratios) < _ALIKE


def _centres(boxes: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 2"]:
    return (boxes[:, :2] + boxes[:, 2:]) / 2


def _agreed(boxes: list[Box], calibration: TableCalibration, gate: float) -> Box | None:
    """Median box of those near the median place, if they are more than half."""
    if not boxes:
        return None
    stacked = np.array(boxes)
    places = calibration.to_table(_centres(stacked))
    near = np.linalg.norm(places - np.median(places, axis=0), axis=1) <= gate
    if not 2 * near.sum() > len(boxes):
        return None
    left, top, right, bottom = np.median(stacked[near], axis=0).tolist()
    return left, top, right, bottom
