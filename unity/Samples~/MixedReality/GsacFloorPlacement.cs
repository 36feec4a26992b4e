using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>Puts the person where the user looks on the floor, facing the user, when asked.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Floor Placement")]
    public sealed class GsacFloorPlacement : MonoBehaviour
    {
        const float Steepest = 0.05f; // of a ray: less looks over the floor

        [SerializeField] GsacCast cast = null;
        [SerializeField, Tooltip("Along whose view the floor is looked for: the eye's or a controller's.")] Transform pointer = null;
        [SerializeField, Tooltip("m: height of the floor where the room does not know it.")] float usualFloor = 0;
        [SerializeField, Tooltip("m: the farthest place.")] float farthest = 6;

        IGsacRoom room;

        void Start()
        {
            room = GetComponent<IGsacRoom>();
            Place();
        }

        /// <summary>False where the pointer meets no floor.</summary>
        public bool Place()
        {
            GsacAvatar person = cast == null ? null : cast.First;
            Vector3 place;
            if (person == null || pointer == null || !TryFloor(out place)) return false;
            Vector3 back = pointer.position - place;
            float yaw = Mathf.Atan2(back.x, back.z) * Mathf.Rad2Deg;
            person.transform.SetPositionAndRotation(place, Quaternion.Euler(0, yaw, 0));
            return true;
        }

        bool TryFloor(out Vector3 place)
        {
            Vector3 from = pointer.position, ahead = pointer.forward;
            if (room != null && room.TryFloor(from, ahead, out place)) return Vector3.Distance(from, place) <= farthest;
            place = from;
            if (ahead.y > -Steepest) return false;
            place = from + ahead * ((usualFloor - from.y) / ahead.y);
            return from.y > usualFloor && Vector3.Distance(from, place) <= farthest;
        }
    }
}
