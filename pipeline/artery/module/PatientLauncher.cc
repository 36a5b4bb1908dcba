// SPDX-License-Identifier: GPL-2.0-only
#include <omnetpp.h>
#include <traci/Launcher.h>

namespace advpipe
{

/// See PatientLauncher.ned.
class PatientLauncher : public traci::Launcher, public omnetpp::cSimpleModule
{
public:
    traci::ServerEndpoint launch() override
    {
        traci::ServerEndpoint sumo;
        sumo.hostname = par("hostname").stringValue();
        sumo.port = par("port");
        sumo.clientId = par("clientId");
        sumo.retry = true;
        return sumo;
    }
};

Define_Module(PatientLauncher)

} // namespace advpipe
