// SPDX-License-Identifier: GPL-2.0-only
#include "Sender.h"

#include <artery/inet/VanetTxControl.h>
#include <cmath>
#include <vanetza/access/access_category.hpp>
#include <vanetza/access/ethertype.hpp>
#include <vanetza/dcc/mapping.hpp>

using namespace omnetpp;

namespace advpipe
{

Define_Module(Sender)

void Sender::schedule(cPacket* packet, double powerDbm, const simtime_t& time)
{
    Enter_Method_Silent();
    take(packet);
    auto request = new inet::physicallayer::Ieee80211TransmissionRequest();
    request->setPower(inet::W(std::pow(10.0, powerDbm / 10.0) / 1000.0));
    auto control = new artery::VanetTxControl();
    control->setDest(inet::MACAddress::BROADCAST_ADDRESS);
    control->setEtherType(vanetza::access::ethertype::GeoNetworking.host());
    const auto category = vanetza::dcc::map_profile_onto_ac(vanetza::dcc::Profile::DP2); // as CaService's
    control->setUserPriority(vanetza::access::user_priority(category));
    control->setTransmissionRequest(request);
    packet->setControlInfo(control);
    scheduleAt(time, packet);
}

void Sender::handleMessage(cMessage* message)
{
    if (message->isSelfMessage()) {
        send(message, "lowerLayerOut");
    } else {
        delete message;
    }
}

} // namespace advpipe
