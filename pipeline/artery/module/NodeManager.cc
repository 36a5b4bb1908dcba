// SPDX-License-Identifier: GPL-2.0-only
#include "NodeManager.h"

#include <artery/networking/GeoNetPacket.h>
#include <artery/utility/Identity.h>
#include <cmath>
#include <inet/common/LayeredProtocolBase.h>
#include <inet/common/ModuleAccess.h>
#include <inet/linklayer/ieee80211/mac/Ieee80211Mac.h>
#include <limits>
#include <traci/API.h>

using namespace omnetpp;
using artery::Identity;
using inet::LayeredProtocolBase;

namespace advpipe
{

Define_Module(NodeManager)

namespace
{

constexpr unsigned cProtocol = 1; ///< of the records; records.py has the same number
constexpr double cSameTime = 1e-6; ///< s; SUMO counts whole milliseconds

std::string sDate; ///< of Artery's time 0, in UTC

cNEDValue date(cComponent*, cNEDValue[], int)
{
    return cNEDValue(sDate);
}

Define_NED_Function(date, "string advpipe_date()");

} // namespace

NodeManager::NodeManager() : mRadios(mLink, [](const cPacket& packet) { return packet.getTreeId(); })
{
}

NodeManager::~NodeManager()
{
    cancelAndDelete(mTick);
}

void NodeManager::initialize()
{
    const auto version = std::to_string(OMNETPP_VERSION >> 8) + "." + std::to_string(OMNETPP_VERSION & 0xff);
    mLink.open(par("host"), par("port"));
    mLink.write(Record('H').number(cProtocol, 2).text("OMNeT++ " + version));
    mLink.flush();
    BasicNodeManager::initialize();
    mTick = new cMessage("tell advpipe the time");
    mTick->setSchedulingPriority(std::numeric_limits<short>::min()); // as the step of traci::Core
    for (auto signal : { Identity::changeSignal, LayeredProtocolBase::packetReceivedFromUpperSignal }) {
        getSystemModule()->subscribe(signal, static_cast<cListener*>(this));
    }
    mRadios.listen();
}

void NodeManager::finish()
{
    mLink.flush();
    BasicNodeManager::finish();
}

void NodeManager::traciInit()
{
    BasicNodeManager::traciInit();
    mStep = getAPI()->simulation.getDeltaT();
    mSumoOffset = getAPI()->simulation.getTime() - simTime().dbl();
    scheduleAt(simTime() + mStep, mTick);
}

/// Right before each step of SUMO: traci::Core schedules its step later, with the same priority.
void NodeManager::handleMessage(cMessage*)
{
    mLink.write(Record('T').number(ns(simTime()), 8));
    mLink.flush();
    scheduleAt(simTime() + mStep, mTick);
}

/// Right after each step of SUMO.
void NodeManager::traciStep()
{
    const double apart = getAPI()->simulation.getTime() - mSumoOffset - simTime().dbl();
    if (std::abs(apart) > cSameTime) {
        throw cRuntimeError("SUMO is %g s ahead of Artery", apart);
    }
    const auto answer = mLink.ask(Record('B').number(ns(simTime()), 8));
    if (!mHasBegun && !answer.empty()) {
        mHasBegun = true;
        sDate = answer;
        for (auto& waiting : mWaiting) {
            if (waiting.second == SIMTIME_MAX) {
                waiting.second = simTime() + uniform(0.0, par("switchOnWithin"));
            }
        }
    }
    for (auto waiting = mWaiting.begin(); mHasBegun && waiting != mWaiting.end();) {
        if (waiting->second <= simTime()) {
            BasicNodeManager::addVehicle(waiting->first);
            waiting = mWaiting.erase(waiting);
        } else {
            ++waiting;
        }
    }
    BasicNodeManager::traciStep();
}

void NodeManager::addVehicle(const std::string& id)
{
    auto& vehicle = getAPI()->vehicle;
    const Record question = Record('A').text(id).text(vehicle.getTypeID(id)).text(vehicle.getVehicleClass(id));
    const auto answer = mLink.ask(question);
    if (answer.empty()) {
        return;
    } else if (mHasBegun) {
        BasicNodeManager::addVehicle(id);
    } else {
        mWaiting[id] = answer == "now" ? SIMTIME_ZERO : SIMTIME_MAX;
    }
}

void NodeManager::removeVehicle(const std::string& id)
{
    mWaiting.erase(id);
    BasicNodeManager::removeVehicle(id);
}

void NodeManager::receiveSignal(cComponent* source, simsignal_t signal, long changes, cObject* details)
{
    auto identity = dynamic_cast<Identity*>(details);
    if (signal == Identity::changeSignal && identity && changes & Identity::ChangeStationId) {
        auto host = inet::getContainingNode(check_and_cast<cModule*>(source));
        mRadios.add(*host, identity->application);
        mLink.write(Record('V').number(ns(simTime()), 8).number(identity->application, 4)
                .real(transmitPowerDbm(host)).text(identity->traci));
    }
}

void NodeManager::receiveSignal(cComponent* source, simsignal_t signal, cObject* frame, cObject*)
{
    if (signal == LayeredProtocolBase::packetReceivedFromUpperSignal && dynamic_cast<inet::ieee80211::Ieee80211Mac*>(source)) {
        handedToRadio(source, frame);
    }
}

void NodeManager::handedToRadio(cComponent* mac, cObject* frame)
{
    const auto id = mRadios.station(mac);
    const auto packet = dynamic_cast<const artery::GeoNetPacket*>(packetIn(frame));
    if (id < 0 || !packet) {
        return;
    }
    const auto view = create_byte_view(packet->getPayload(), vanetza::OsiLayer::Network, vanetza::OsiLayer::Application);
    mLink.write(Record('S').number(ns(simTime()), 8).number(id, 4).number(packet->getTreeId(), 8)
            .rest(std::string(view.begin(), view.end())));
}

double NodeManager::transmitPowerDbm(cModule* host) const
{
    auto transmitter = host->getModuleByPath(".wlan[0].radio.transmitter");
    return transmitter ? db(1000.0 * transmitter->par("power").doubleValue()) : NaN;
}

} // namespace advpipe
