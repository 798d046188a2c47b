"""Wrong usage of `robochoc solve`: status 2 and a message, and nothing is done, printed or written."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.support.cases import cases
from tests.support.program import ROOT, robochoc_within

EXAMPLES = ROOT / "docs" / "examples"
REFUSED = {
    ROOT / "instances" / "queens3d-4": [
        ("--protocol abtt", "no protocol 'abtt' is installed; did you mean 'abt'"),
        ("--protocol qqq", "no protocol 'qqq' is installed; 'robochoc protocols' lists them"),
        ("--runtime threads", "threads"),
        ("--seed -1", "--seed"),
        ("--timeout 0", "--timeout"),
        ("--withdraw=most", "minimum"),
        ("--set cycles", "NAME=VALUE"),
        ("--protocol abt --set cycles=5", "no setting"),
        ("--protocol dsa --set cycles=0", "cycles"),
        ("--protocol dsa --set cycles=many", "cycles"),
        ("--protocol dsa --set circles=5", "cycles"),
        ("--protocol dsa --withdraw", "requires a proof"),
        ("--protocol central --set cycles=5", "--set"),
        ("--explain --json", "--explain"),
        ("--nonsense", "--nonsense"),
        ("--timeout nan", "--timeout"),
        ("--html ''", "--html"),
        ("--html x --journal ./x", "are the same place"),
        ("''", "empty"),
        ("--delay 3", "--runtime simulator"),
        ("--schedule random", "--runtime simulator"),
        ("--runtime simulator --schedule random --delay 3", "--schedule concurrent"),
        ("--withdraw minimal", "'minimal' is neither a kind of withdrawal nor a folder: minimum or maximal"),
        ("--withdraw maximla", "'maximla' is neither a kind of withdrawal nor a folder: minimum or maximal"),
        ("--spare two", "'two' is neither a number of robots nor a folder"),
        ("--sniff 'Robto1.*'", "queens3d-4 has no robot called 'Robto1.*'"),
        ("--sniff=Robot1.1,Nobody", "queens3d-4 has no robot called 'Nobody'"),
        ("--order max-degre", "did you mean 'max-degree'"),
        ("--order no/such/file", "neither a known order nor a file"),
        ("--order ''", "neither a known order"),
        ("--order dfs --protocol central", "--protocol central"),
        ("--protocol abt --count", "--count"),
        ("--protocol central --verify --count", "--verify"),
        ("--protocol central --withdraw maximal", "--withdraw"),
        ("--protocol central --count --html page.html", "--html"),
        ("--local-solutions=0", "--local-solutions"),
        ("--local-timeout=0", "--local-timeout"),
        ("--local-timeout=nan", "--local-timeout"),
        ("--local-timeout=-1", "--local-timeout"),
        ("--runtime network --standby 1 --sniff", "--standby cannot be used with --journal or --sniff"),
        ("--runtime network --standby 1 --journal x", "--standby cannot be used with --journal or --sniff"),
        ("--sniff --serve", "--serve cannot be used with --sniff"),
        ("--open", "--open requires --sniff"),
        ("--sniff --protocol central --count", "--count reports only a number"),
        ("--withdraw=Fewest", "minimum"),
        ("--protocol '?'", "'?'"),
    ],
    EXAMPLES / "scouts": [
        ("--channel wlan", "add --runtime simulator"),
        ("--channel wlan --runtime simulator --delay 5", "remove --delay"),
        ("--channel wlan --runtime simulator --schedule random", "remove --delay and --schedule"),
        ("--channel wlam --runtime simulator", "did you mean 'wlan'?"),
        ("--channel '' --runtime simulator", "channels: wlan"),
        ("--channel wlan --runtime simulator --protocol central", "not for --protocol central"),
    ],
    EXAMPLES / "hangar": [
        ("--situation flight --withdraw", "--withdraw is for problems that do not change"),
        ("--situation flight --runtime network", "--runtime network is for problems that do not change"),
        ("--situation flight --protocol central", "--protocol central is for problems that do not change"),
        ("--ros mcap:a.mcap --count --protocol central", "--count reports only a number"),
        ("--obstacle 1,1,1", "--obstacle applies to the simulated flight"),
        ("--fail Fin", "--fail applies to the simulated flight"),
        ("--wind 1,1,1 --situation mcap:a", "--wind applies to the simulated flight"),
        ("--distance 1", "--distance applies to the simulated flight"),
        ("--improve 1", "--improve continues after --deadline SECONDS"),
        ("--improve 1 --deadline 1 --protocol central", "--deadline is for robots"),
        ("--downwash 2", "--downwash applies to the simulated flight"),
        ("--situation flight --downwash 2 --fail Fin", "downwash cannot be combined with motor failures"),
        ("--patience 1 --runtime simulator", "--patience is only for robots that run as processes"),
        ("--patience 1 --protocol central", "--patience is only for robots that run as processes"),
        ("--patience 0", "--patience"),
        ("--battery 0.1 --situation flight", "--battery applies to reports of robots"),
        ("--frame hall", "--frame requires --ros SINK"),
        ("--scale 2", "--scale requires --ros SINK"),
        ("--ros mcap:a --situation mcap:a", "--situation mcap:a and --ros mcap:a are the same place"),
        ("--ros mcap:a --ros mcap:a", "mcap:a is given twice"),
        ("--ros mcap:a.mcap --ros ./a.mcap", "--ros mcap:a.mcap and --ros ./a.mcap are the same place"),
        ("--ros a.mcap --ros rosbag:a.mcap", "--ros a.mcap and --ros rosbag:a.mcap are the same place"),
        ("--ros mcap:a --journal a", "--journal a and --ros mcap:a are the same place"),
        ("--ros mcap:a --html a", "--html a and --ros mcap:a are the same place"),
        ("--situation flight --wind 1e9", "is faster than the maximum of 200 m/s"),
        ("--situation flight --gusts 1e9", "they must be from 0 to 200 m/s"),
        ("--scale 1e300 --ros mcap:a", "--scale"),
        ("--situation flight --fail Wing", "no drone 'Wing' to fail"),
        ("--situation flight --fail Fin@soon", "is not of the form ROBOT or ROBOT@SECONDS"),
        ("--situation flight --obstacle 1,2", "is not three numbers"),
        ("--situation flight --obstacle 1,2,nan", "is not three numbers"),
        ("--scale nan --ros mcap:a", "--scale"),
        ("--scale inf --ros mcap:a", "--scale"),
        ("--battery nan --situation mcap:a", "--battery"),
        ("--patience nan", "--patience"),
        ("--report-timeout nan --situation mcap:a", "--report-timeout"),
        ("--report-timeout 1", "--report-timeout applies to reports of robots"),
        ("--situation flight --wind strong", "'strong' is neither a speed such as 3 nor three numbers"),
        ("--situation flite", "rospy; did you mean 'flight'?"),
        ("--seed x", "'x' is not a whole number from 0 to 18,446,744,073,709,551,615"),
        ("--messages 1000000000001", "is not a whole number from 1 to 1,000,000,000,000"),
        ("--message-loss 3", "'3' is not a number from 0 to 0.9"),
        ("--deadline 0", "'0' is not a number greater than 0"),
        ("--ros mcap:run.mcap --frame ''", "is not the name of a frame, such as map"),
        ("--ros mcap:run.mcap --frame 'two words'", "is not the name of a frame, such as map"),
        ("--ros mcap:run.mcap --frame 'a\nb'", "is not the name of a frame, such as map"),
    ],
    EXAMPLES / "rescue": [
        ("--withdraw", "--withdraw is for problems that do not change"),
        ("--protocol central --count", "--count is for problems that do not change"),
    ],
    ROOT / "instances": [
        ("--sniff", "accept one team; 2 were found"),
        ("--html page.html", "2 were found"),
        ("--ros mcap:a", "--ros and --situation accept one team; 2 were found"),
    ],
}
"""By team: further words of the command line, and a part of the message."""


@pytest.mark.usefixtures("in_a_folder")
def test_wrong_usage_is_status_2(tmp_path: Path) -> None:
    with cases() as each:
        for team, rows in REFUSED.items():
            for words, said in rows:
                with each(f"{team.name} {words}"):
                    done = robochoc_within("solve", team, *shlex.split(words))
                    assert (done.returncode, done.stdout) == (2, "")
                    assert said in " ".join(done.stderr.split())
                    assert not list(tmp_path.iterdir())
