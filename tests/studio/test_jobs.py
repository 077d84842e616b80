"""Jobs run one after another, report progress, have results, are cancelled, and fail alone."""

from __future__ import annotations

import threading
import time

import pytest

from choreograph.core.errors import ParameterError
from choreograph.studio.jobs import Jobs
from choreograph.studio.refusals import ConflictError, NotFoundError


@pytest.fixture
def jobs():
    made = Jobs()
    yield made
    made.close()


def ended(job):
    deadline = time.monotonic() + 5
    while job.state == "running":
        assert time.monotonic() < deadline
        time.sleep(0.001)
    return job


def test_jobs_of_a_lane_run_in_order_and_have_results(jobs):
    order = []
    for i in range(5):
        last = jobs.start("count", lambda job, i=i: order.append(i) or i)
    assert ended(last).result == 4 and order == [0, 1, 2, 3, 4]
    assert last.facts["state"] == "done" and last.facts["result"] == 4


def test_a_lane_does_not_wait_for_another(jobs):
    go = threading.Event()
    slow = jobs.start("build", lambda job: go.wait(5), lane="builds")
    assert jobs.do("quick", lambda job: 7) == 7 and slow.state == "running"
    go.set()
    ended(slow)


def test_a_cancelled_job_ends_at_its_next_report_and_the_next_runs(jobs):
    began = threading.Event()

    def work(job):
        began.set()
        while True:
            job.report("dancing", 1, 2)

    job = jobs.start("long", work)
    began.wait(5)
    jobs.cancel(job.id)
    assert ended(job).state == "cancelled" and "result" not in job.facts
    assert jobs.do("next", lambda job: 1) == 1


def test_a_job_that_waits_is_cancelled_before_it_begins(jobs):
    go, touched = threading.Event(), []
    jobs.start("first", lambda job: go.wait(5))
    second = jobs.start("second", lambda job: touched.append(1))
    jobs.cancel(second.id)
    go.set()
    assert ended(second).state == "cancelled" and touched == []


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [(ParameterError("expected x, got y"), 400, "expected x"), (ConflictError("old"), 409, "old"),
     (ZeroDivisionError("secret path"), 500, "a bug")],
)  # fmt: skip
def test_a_failed_job_says_why_and_a_bug_tells_no_details(jobs, error, status, said):
    def work(job):
        raise error

    job = ended(jobs.start("bad", work))
    assert job.state == "failed" and job.facts["status"] == status and said in job.error
    assert "secret" not in job.error
    with pytest.raises(type(error)):
        jobs.do("bad", work)
    assert jobs.do("next", lambda job: 1) == 1


def test_progress_and_the_log_are_told(jobs):
    news = []
    told = Jobs(lambda job: news.append(job.facts))

    def work(job):
        for i in range(500):
            job.say(f"line {i}")
        job.report("dancing", 3, 4)

    job = ended(told.start("build", work))
    told.close()
    assert job.log[-1] == "line 499" and len(job.log) <= 400
    assert (job.stage, job.done, job.total) == ("dancing", 3, 4)
    assert news[-1]["state"] == "done"


def test_old_jobs_are_forgotten(jobs):
    first = jobs.start("old", lambda job: 1)
    for _ in range(60):
        jobs.do("new", lambda job: 1)
    with pytest.raises(NotFoundError):
        jobs.get(first.id)


def test_a_first_part_is_there_before_the_end(jobs):
    go_on = threading.Event()

    def work(job):
        job.show({"part": 1})
        go_on.wait(5)
        return {"all": 2}

    job = jobs.start("dance", work)
    assert job.begun.wait(5) and job.first == {"part": 1} and not job.ended.is_set()
    assert "first" not in job.facts
    go_on.set()
    assert ended(job).result == {"all": 2}
    without = ended(jobs.start("dance", lambda job: None))
    assert without.begun.wait(5) and without.first is None


def test_a_cancelled_job_shows_nothing(jobs):
    def work(job):
        job.cancelled.wait(5)
        job.show({"part": 1})

    job = jobs.start("dance", work)
    jobs.cancel(job.id)
    assert ended(job).state == "cancelled" and job.first is None
