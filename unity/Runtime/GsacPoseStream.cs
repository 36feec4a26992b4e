using System;
using System.Net;
using System.Net.Sockets;
using System.Threading;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Poses and expressions that come live over UDP, a JSON message or an OSC packet each datagram (GsacPoseMessage), smoothed.
    /// They lie over whatever else moves the person: only what was named moves, from where it stands, and only of the chosen parts.
    /// Listens to this machine only, unless `Any Address` is on. Whatever is not a message is counted by its fault and left.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Pose Stream")]
    [DefaultExecutionOrder(9300)] // after the avatar, before it is drawn
    [RequireComponent(typeof(GsacAvatar))]
    public sealed class GsacPoseStream : MonoBehaviour
    {
        const int LargestDatagram = 65536;
        const int PatienceUs = 100000;

        [SerializeField] int port = 9000;
        [SerializeField, Tooltip("Listen to other machines too.")] bool anyAddress = false;
        [SerializeField, Tooltip("What the stream moves; the rest is left to the Animator, the clip or the script.")]
        GsacParts parts = GsacParts.All;
        [SerializeField, Tooltip("s: time constant of the smoothing; 0 for none.")] float smoothing = 0.06f;

        readonly object padlock = new object();
        readonly byte[] datagram = new byte[LargestDatagram];
        readonly int[] refused = new int[Enum.GetValues(typeof(GsacMessageFault)).Length];
        GsacAvatar avatar;
        GsacData data;
        GsacPoseMessage message;
        GsacParts[] partOf;
        GsacLivePose incoming;
        GsacLivePose shown;
        Socket socket;
        Thread thread;
        bool wanted; // between OnEnable and OnDisable, whether or not the port could be opened
        volatile bool listening;

        /// <summary>Messages taken, and datagrams that were none.</summary>
        public int Received { get; private set; }
        public int Refused { get; private set; }

        /// <summary>Why the last one was refused; None where all were taken.</summary>
        public GsacMessageFault LastFault { get; private set; }

        /// <summary>Datagrams that were refused for this fault.</summary>
        public int RefusedFor(GsacMessageFault fault)
        {
            return refused[(int)fault];
        }

        /// <summary>What the stream moves; the rest is left to the Animator, the clip or the script.</summary>
        public GsacParts Parts
        {
            get { return parts; }
            set { parts = value; }
        }

        /// <summary>s: time constant of the smoothing; 0 for none.</summary>
        public float Smoothing
        {
            get { return smoothing; }
            set { smoothing = value; }
        }

        /// <summary>The UDP port that is listened to. Another one is listened to at once where the stream is enabled.</summary>
        public int Port
        {
            get { return port; }
            set
            {
                if (port == value) return;
                port = value;
                if (!wanted) return;
                Close();
                Open();
            }
        }

        void OnEnable()
        {
            avatar = GetComponent<GsacAvatar>();
            if (avatar.IsOpen) Prepare();
            wanted = true;
            Open();
        }

        void Open()
        {
            socket = new Socket(AddressFamily.InterNetwork, SocketType.Dgram, ProtocolType.Udp);
            try
            {
                socket.Bind(new IPEndPoint(anyAddress ? IPAddress.Any : IPAddress.Loopback, port));
            }
            catch (SocketException e)
            {
                Debug.LogError(name + ": UDP port " + port + " cannot be opened (" + e.Message + "); choose another in Gsac Pose Stream", this);
                socket.Close();
                socket = null;
                return;
            }
            listening = true;
            thread = new Thread(Listen) { IsBackground = true, Name = "Gsac pose stream" };
            thread.Start();
        }

        /// <summary>For the avatar's file as it is now.</summary>
        void Prepare()
        {
            data = avatar.Data;
            message = new GsacPoseMessage(data);
            partOf = GsacHumanBones.Parts(data.JointNames);
            incoming = new GsacLivePose(data);
            shown = new GsacLivePose(data);
        }

        void OnDisable()
        {
            wanted = false;
            Close();
        }

        void Close()
        {
            listening = false;
            if (socket == null) return;
            thread.Join();
            socket.Close();
            socket = null;
        }

        void Listen()
        {
            while (listening)
            {
                int length;
                try
                {
                    // a timeout would be an exception, and garbage, several times a second
                    if (!socket.Poll(PatienceUs, SelectMode.SelectRead)) continue;
                    length = socket.Receive(datagram);
                }
                catch (SocketException e)
                {
                    if (e.SocketErrorCode == SocketError.ConnectionReset || e.SocketErrorCode == SocketError.MessageSize) continue;
                    return;
                }
                lock (padlock)
                {
                    if (message == null) continue;
                    GsacMessageFault fault = message.Read(datagram, length, incoming);
                    if (fault == GsacMessageFault.None)
                    {
                        Received++;
                        continue;
                    }
                    LastFault = fault;
                    Refused++;
                    refused[(int)fault]++;
                }
            }
        }

        void LateUpdate()
        {
            if (!avatar.IsOpen) return;
            Transform[] joints = avatar.Joints;
            GsacShapes weights = avatar.Weights;
            lock (padlock)
            {
                if (!ReferenceEquals(data, avatar.Data)) Prepare();
                float stay = GsacPose.Stay(Time.deltaTime, smoothing);
                bool body = (parts & GsacParts.Body) != 0, face = (parts & GsacParts.Face) != 0;
                for (int j = 0; j < joints.Length; j++)
                {
                    Turn(joints[j], j, stay, incoming.HasJoint[j] && (parts & partOf[j]) != 0);
                }
                Shift(joints[0], stay, incoming.HasTransl && body);
                for (int e = 0; e < weights.Count; e++) Weigh(weights, e, stay, incoming.HasWeight[e] && face);
            }
        }

        void Turn(Transform joint, int j, float stay, bool live)
        {
            if (live && !shown.HasJoint[j]) GsacSkeleton.ReadTurn(shown.Pose, j, joint);
            shown.HasJoint[j] = live;
            if (!live) return;
            shown.Pose.Approach(incoming.Pose, j, stay);
            GsacSkeleton.ApplyTurn(shown.Pose, j, joint);
        }

        void Shift(Transform root, float stay, bool live)
        {
            if (live && !shown.HasTransl) GsacSkeleton.ReadTransl(shown.Pose, data, root);
            shown.HasTransl = live;
            if (!live) return;
            shown.Pose.ApproachTransl(incoming.Pose, stay);
            GsacSkeleton.ApplyTransl(shown.Pose, data, root);
        }

        void Weigh(GsacShapes weights, int e, float stay, bool live)
        {
            if (live && !shown.HasWeight[e]) shown.Weights[e] = weights[e];
            shown.HasWeight[e] = live;
            if (!live) return;
            shown.Weights[e] = incoming.Weights[e] + (shown.Weights[e] - incoming.Weights[e]) * stay;
            weights[e] = shown.Weights[e];
        }
    }
}
