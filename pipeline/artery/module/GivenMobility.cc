// SPDX-License-Identifier: GPL-2.0-only
#include "GivenMobility.h"

namespace advpipe
{

Define_Module(GivenMobility)

void GivenMobility::place(const inet::Coord& position)
{
    Enter_Method_Silent();
    mPosition = position;
    emit(mobilityStateChangedSignal, this);
}

} // namespace advpipe
