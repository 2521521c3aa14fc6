"""The report of one or more adaptations: pictures, films and one self-contained page."""

from prior_reinforce.report.film import Film, film_strip, record_film, write_film
from prior_reinforce.report.page import write_report
from prior_reinforce.report.record import AdaptationRecord

__all__ = [
    "AdaptationRecord",
    "Film",
    "film_strip",
    "record_film",
    "write_film",
    "write_report",
]
