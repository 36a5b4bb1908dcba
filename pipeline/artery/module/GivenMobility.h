// SPDX-License-Identifier: GPL-2.0-only
#pragma once

#include <inet/mobility/contract/IMobility.h>
#include <omnetpp.h>

namespace advpipe
{

/// A station's antenna is where advpipe says, until it says otherwise.
class GivenMobility : public inet::IMobility, public omnetpp::cSimpleModule
{
public:
    void place(const inet::Coord&);

    double getMaxSpeed() const override { return NaN; }
    inet::Coord getCurrentPosition() override { return mPosition; }
    inet::Coord getCurrentSpeed() override { return inet::Coord::ZERO; }
    inet::EulerAngles getCurrentAngularPosition() override { return inet::EulerAngles::ZERO; }
    inet::EulerAngles getCurrentAngularSpeed() override { return inet::EulerAngles::ZERO; }
    inet::Coord getConstraintAreaMax() const override { return inet::Coord::ZERO; }
    inet::Coord getConstraintAreaMin() const override { return inet::Coord::ZERO; }

private:
    inet::Coord mPosition;
};

} // namespace advpipe
