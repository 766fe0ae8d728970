// Which verbs have a model or a result, and recordings? Each has its file, with its options and what it does.
#pragma once

#include "jobs/verb.h"

namespace identikal {

Verb tune_verb();
Verb fit_verb();
Verb check_verb();
Verb track_verb();
Verb filter_verb();
Verb compare_verb();
Verb shape_verb();
Verb bound_verb();
Verb validate_verb();
Verb simulate_verb();
Verb handling_verb();
Verb forecast_verb();
Verb digest_verb();
Verb model_verb();

}  // namespace identikal
