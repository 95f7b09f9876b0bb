"""Job files of the batch."""

from .job import Job, JobGoal, JobTake
from .read import read_job

__all__ = ["Job", "JobGoal", "JobTake", "read_job"]
