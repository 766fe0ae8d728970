// Which verbs has the program alone? Each has its file, with its options and what it does.
#pragma once

#include "jobs/verb.h"

namespace identikal {

Verb info_verb();
Verb init_verb();
Verb report_verb();
Verb export_verb();
Verb study_verb();

}  // namespace identikal
