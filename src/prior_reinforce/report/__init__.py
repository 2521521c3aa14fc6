"""The report of one or more goals: pictures, films and one self-contained page."""

from prior_reinforce.report.film import record_film as record_film
from prior_reinforce.report.page import write_report as write_report
from prior_reinforce.report.record import AdaptationRecord as AdaptationRecord
from prior_reinforce.report.record import Film as Film
