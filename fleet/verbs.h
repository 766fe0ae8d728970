// Which verbs have a fleet: many recordings, one row of results each?
#pragma once

#include "jobs/verb.h"

namespace identikal {

Verb fleet_tune_verb();
Verb fleet_fit_verb();
Verb fleet_joint_verb();
Verb fleet_check_verb();
Verb fleet_validate_verb();
Verb fleet_resume_verb();
Verb fleet_status_verb();
Verb fleet_export_verb();
Verb fleet_population_verb();
Verb fleet_coverage_verb();
Verb fleet_report_verb();
Verb fleet_merge_verb();

}  // namespace identikal
